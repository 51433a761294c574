#!/usr/bin/env bash
# svl on AArch64, under qemu: the tests of what a robot links, the examples in C and C++, and, with the argument `all`, the
# whole program: results on recordings and the rendered arena are compared with those of this machine.
# Installs what it needs on Debian x86-64 with apt-get and rustup. The emulator is slow: its times mean nothing.
set -euo pipefail
cd "$(dirname "$0")/.."
triple=aarch64-unknown-linux-gnu
packages="gcc-aarch64-linux-gnu g++-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static"
if [ "$(uname -sm)" != "Linux x86_64" ]; then
  echo "skipped: these tests run on Linux x86_64"
  exit 0
fi
if ! { command -v qemu-aarch64-static && command -v aarch64-linux-gnu-g++; } > /dev/null; then
  as_root=""
  [ "$(id -u)" = 0 ] || as_root="sudo -n"
  install="$as_root apt-get install -qq -y --no-install-recommends $packages"
  $install > /dev/null 2>&1 || { $as_root apt-get update -qq && $install > /dev/null; }
fi
# The standard library: rustup's, or that of Debian beside its rustc.
if command -v rustup > /dev/null; then
  rustup --quiet target add "$triple"
elif [ ! -d "$(rustc --print sysroot)/lib/rustlib/$triple" ]; then
  echo "Rust's standard library for $triple is missing: install rustup, or unpack Debian's libstd-rust-dev:arm64" >&2
  exit 1
fi

target="$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')"
root=/usr/aarch64-linux-gnu
emulator() { qemu-aarch64-static -L "$root" "$@"; }
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L $root"
step() { printf '\n== %s (%ss)\n' "$*" "$SECONDS"; "$@"; }
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

# Skipped: statistics of thousands of solved calibrations, which take minutes here and touch no kernel; and a program that
# does not exist, of which the emulator says that it was started.
step cargo test --release --locked --target "$triple" -p svl-calibrate --test lean -- \
  --skip solve::coverage --skip a_command_that_cannot_start
step cargo test --release --locked --target "$triple" -p svl-core -p svl-c --lib --test c_memory

# The C library: same cells as on x86-64.
examples() { # compiler prefix, folder of the library, command to run
  local prefix="$1" library="$2/libsvl_c.a" out="$work/${1:-x86-}"
  shift 2
  local flags="-Wall -Werror -I src/c/include" libraries="$library -lpthread -ldl -lm -Wl,--gc-sections"
  # shellcheck disable=SC2086
  "${prefix}gcc" -std=c99 $flags src/c/examples/stop.c $libraries -o "${out}c"
  # shellcheck disable=SC2086
  "${prefix}g++" -std=c++11 $flags src/c/examples/stop.cpp $libraries -o "${out}cpp"
  "$@" "${out}c" "$work/left.pgm" "$work/right.pgm"
  "$@" "${out}cpp"
}
python3 - "$work" << 'PYTHON'
import sys
def texture(x, y):
    mixed = (x * 0x9E3779B9 ^ y * 0x85EBCA6B) & 0xFFFFFFFF
    return (mixed * 0xC2B2AE35 & 0xFFFFFFFF) >> 24
for name, shift in ("left", 0), ("right", 20):
    pixels = bytes(texture(x + shift, y) if x < 200 else 90 for y in range(240) for x in range(320))
    open(f"{sys.argv[1]}/{name}.pgm", "wb").write(b"P5 320 240 255\n" + pixels)
PYTHON
for arguments in "" "--target $triple"; do
  # shellcheck disable=SC2086
  step cargo rustc --quiet --release --locked -p svl-c --lib --crate-type staticlib $arguments
done
examples "" "$target/release" env > "$work/x86.txt"
examples aarch64-linux-gnu- "$target/$triple/release" emulator > "$work/aarch64.txt"
cat "$work/aarch64.txt"
cmp "$work/x86.txt" "$work/aarch64.txt"

[ "${1:-}" = all ] || exit 0
step cargo build --release --locked --bin svl
step cargo build --release --locked --bin svl --target "$triple"
here="$target/release/svl"
there() { emulator "$target/$triple/release/svl" "$@"; }
algorithms="$(for name in dp v1 v2 v3 v4 v5 v5:target=near bm sgm; do printf -- '--algo %s ' $name; done)"
cd "$work"
"$here" -q record arena --frames 6 -o arena.mcap
# A recording of 640 px: v5 decides at two sizes.
"$here" score arena --print-scenario | sed 's/width_px = 320/width_px = 640/; s/height_px = 240/height_px = 480/' > wide.toml
"$here" -q record wide.toml --frames 3 -o wide.mcap
"$here" -q replay wide.mcap --algo v5 --rows wide.csv
step there replay wide.mcap --algo v5 --verify=wide.csv
# shellcheck disable=SC2086
"$here" -q replay arena.mcap $algorithms --rows rows.csv
step there info arena.mcap
# shellcheck disable=SC2086
step there replay arena.mcap $algorithms --verify=rows.csv
# The renderer asks the platform for sin, cos and powf: are the arenas the same?
there -q record arena --frames 6 -o aarch64.mcap
step "$here" replay aarch64.mcap --verify=rows.csv
# shellcheck disable=SC2086
"$here" -q score arena.mcap $algorithms --rerun none -o x86
# shellcheck disable=SC2086
there -q score arena.mcap $algorithms --rerun none -o aarch64
step "$here" compare x86 aarch64
