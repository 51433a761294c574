#!/usr/bin/env bash
# Counts AArch64 instructions per pair of each matcher, in millions: matching alone, one thread, 320 x 128 pixels, 64
# disparities, under qemu. The count depends on no clock and no load. Needs what tests/aarch64.sh installs, and qemu-user.
set -euo pipefail
cd "$(dirname "$0")/../.."
triple=aarch64-unknown-linux-gnu
command -v qemu-aarch64 > /dev/null || {
  as_root=""
  [ "$(id -u)" = 0 ] || as_root="sudo -n"
  $as_root apt-get install -qq -y --no-install-recommends qemu-user > /dev/null
}
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
cargo build --quiet --release --locked --target "$triple" -p svl-core --example match_repeatedly
target="$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')"
program="$target/$triple/release/examples/match_repeatedly"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
gcc -shared -fPIC -O2 -o "$work/count.so" tests/aarch64/count.c
counted() { # algorithm, repeats
  qemu-aarch64 -cpu "${SVL_QEMU_CPU:-max}" -L /usr/aarch64-linux-gnu -plugin "$work/count.so" -d plugin \
    "$program" "$1" "$2" "${size[@]}" 2>&1 > /dev/null | tail -1
}
size=(320 128)
for algorithm in "${@:-dp v1 v2 v3 v4 v5 bm sgm}"; do
  for name in $algorithm; do
    first="$(counted "$name:max_disparity=63" 2)"
    last="$(counted "$name:max_disparity=63" 5)"
    awk -v name="$name" -v n="$((last - first))" 'BEGIN { printf "%-4s %7.1f\n", name, n / 3e6 }'
  done
done
