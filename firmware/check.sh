#!/bin/sh
# The firmware's part of the CI: trigger.hex does on a simulated board what README.md says, and is what trigger.c compiles
# to. Installs the tools with apt-get where they are missing.
set -eu
cd "$(dirname "$0")"
packages="make gcc libc6-dev gcc-avr avr-libc binutils-avr libsimavr-dev"

missing() {
  for tool in make cc avr-gcc avr-objcopy; do command -v $tool >/dev/null || return 0; done
  [ ! -e /usr/lib/avr/include/avr/io.h ] || [ ! -e /usr/include/simavr/sim_avr.h ]
}
if missing; then
  if ! command -v apt-get >/dev/null; then
    echo "skipped: the firmware's checks need $packages, and there is no apt-get to install them"
    exit 0
  fi
  as_root=""
  [ "$(id -u)" = 0 ] || as_root="sudo -n"
  install="$as_root apt-get install -qq -y --no-install-recommends $packages"
  $install >/dev/null 2>&1 || { $as_root apt-get update -qq && $install >/dev/null; } || {
    echo "the firmware's checks need $packages, which could not be installed: as root, apt-get install $packages"
    exit 1
  }
fi
make -s check current
