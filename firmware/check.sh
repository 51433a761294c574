#!/bin/sh
# The firmware's part of the CI: trigger.hex does on a simulated board what README.md says, and is what trigger.c compiles
# to. Where the tools are missing it prints the command that installs them, and skips.
set -eu
cd "$(dirname "$0")"
packages="make gcc libc6-dev gcc-avr avr-libc binutils-avr libsimavr-dev"

missing() {
  for tool in make cc avr-gcc avr-objcopy; do command -v $tool >/dev/null || return 0; done
  [ ! -e /usr/lib/avr/include/avr/io.h ] || [ ! -e /usr/include/simavr/sim_avr.h ]
}
if missing; then
  echo "skipped: the firmware's checks need $packages; as root: apt-get install $packages"
  [ -z "${SVL_SKIPPED:-}" ] || echo "the firmware's checks: apt-get install $packages" >> "$SVL_SKIPPED"
  exit 0
fi
make -s check current
