#!/bin/sh
# Two GigE Vision cameras, aravis's own in software, recorded by an svl built with --features genicam. Cameras and svl are
# in network namespaces of their own, so that nothing of it is heard outside. Installs what it needs with apt-get where
# that is missing; where namespaces are not permitted it is skipped.
set -eu
cd "$(dirname "$0")/.."
packages="iproute2 pkg-config libaravis-dev libusb-1.0-0-dev aravis-tools"
fake=arv-fake-gv-camera-0.8

missing() {
  for tool in ip unshare pkg-config $fake; do command -v "$tool" >/dev/null || return 0; done
  ! pkg-config --exists aravis-0.8
}
if [ "${1-}" != in-its-namespace ]; then
  if missing; then
    if ! command -v apt-get >/dev/null; then
      echo "skipped: the GenICam checks need $packages, and there is no apt-get to install them"
      exit 0
    fi
    as_root=""
    [ "$(id -u)" = 0 ] || as_root="sudo -n"
    install="$as_root apt-get install -qq -y --no-install-recommends $packages"
    $install >/dev/null 2>&1 || { $as_root apt-get update -qq && $install >/dev/null; } 2>/dev/null || {
      echo "skipped: the GenICam checks need $packages, which could not be installed: as root, apt-get install $packages"
      exit 0
    }
  fi
  apart="unshare --net"
  [ "$(id -u)" = 0 ] || apart="unshare --net --map-root-user"
  if ! $apart unshare --net ip link add cable type veth peer name plug 2>/dev/null; then
    echo "skipped: the GenICam checks need network namespaces, which are not permitted here"
    exit 0
  fi
  cargo clippy --release --locked --features genicam -- -D warnings
  cargo build --release --locked --features genicam
  svl="$(cargo metadata --format-version 1 --no-deps | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/release/svl"
  exec $apart "$0" in-its-namespace "$svl"
fi

svl="$2"
work="$(mktemp -d)"
cameras=""
trap 'kill $cameras 2>/dev/null || true; rm -rf "$work"' EXIT

# camera NUMBER OPTIONS: starts one at the other end of a cable, 10.77.NUMBER.2; its process is $!.
# shellcheck disable=SC2016
camera() {
  unshare --net sh -c 'ip link add plug type veth peer name "cable$1" netns "$2" && ip link set plug up
    ip addr add "10.77.$1.2/24" dev plug; shift 2; exec "$@"' camera "$1" $$ $fake -i plug "$2" "$3" "$4" "$5" &
  cameras="$cameras $!"
  until ip link set "cable$1" up 2>/dev/null; do sleep 0.02; done
  ip addr add "10.77.$1.1/24" dev "cable$1"
}
# does COMMAND, fails COMMAND: keep what it says.
does() { "$@" >"$work/said" 2>&1 || { echo "$*:" && cat "$work/said" && exit 1; }; }
fails() { ! "$@" >"$work/said" 2>&1 || { echo "$*: did not fail" && exit 1; }; }
says() { grep -q -e "$1" "$work/said" || { echo "'$1' is not in:" && cat "$work/said" && exit 1; }; }
whole() { does "$svl" info "$1" && says "intact     yes" && says "pairs      ${2-[1-9]}"; }

camera 1 -s LEFT7 -r 0
camera 2 -s RIGHT8 -r 0
right=$!
camera 3 -s LOSSY9 -r 2
tries=20
until "$svl" record --list >"$work/said" && [ "$(grep -c "camera: Aravis Fake" "$work/said")" = 3 ]; do
  tries=$((tries - 1))
  [ $tries -gt 0 ] || { echo "the cameras do not answer:" && cat "$work/said" && exit 1; }
done
says "genicam:Aravis-Fake-LEFT7 .*10.77.1.2"
cd "$work"

# Two commands, one to each camera; these answer them in steps of 40 ms.
pair=genicam:Aravis-Fake-LEFT7,Aravis-Fake-RIGHT8
does "$svl" record $pair --rate 10 --frames 30 -o software.mcap
says " 0 pairs dropped"
echo "software: $(sed -n 's/.* images, \(.*\); latency.*/\1/p' said)"
whole software.mcap 30

does "$svl" record genicam:10.77.1.2,10.77.2.2 --trigger free --rate 20 --frames 40 -o free.mcap
says " 0 pairs dropped"
echo "free: $(sed -n 's/.* images, \(.*\); latency.*/\1/p' said)"
whole free.mcap 40

# Images that lack packets are counted, and are in no pair.
does "$svl" record genicam:10.77.1.2,10.77.3.2 --rate 10 --frames 20 -o lossy.mcap
says "[0-9] damaged on the way"
whole lossy.mcap 20

fails "$svl" record genicam:nobody,10.77.2.2 -o none.mcap
says "error: nobody: cannot be opened: .*Aravis-Fake-LEFT7, "
fails "$svl" record genicam:10.77.1.2,Aravis-Fake-LEFT7 -o none.mcap
says "Aravis-Fake-LEFT7: is in use already: by another program, or it is named twice"

# A camera that is gone is named, and what came before is kept.
{ sleep 3 && kill $right; } &
fails "$svl" record $pair -o gone.mcap
says "error: right camera, Aravis-Fake-RIGHT8: "
whole gone.mcap
[ ! -e none.mcap ]
echo "genicam: all passed"
