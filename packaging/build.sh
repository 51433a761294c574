#!/usr/bin/env bash
# Builds the packages of the program: the wheel (packaging/wheel.sh), a Debian package, and a tar for any Linux with glibc
# 2.31 or later (Debian 11, Ubuntu 20.04). Then packaging/check.sh tries them. On two cores it takes half an hour.
#
#   packaging/build.sh                             # for this machine, into target/packages
#   packaging/build.sh aarch64-unknown-linux-gnu   # for ARM boards, into target/packages-aarch64
#   PROFILE=release packaging/build.sh             # a quick try: larger and slower programs
#
# Needs Rust, Python with venv, and the network for its tools: maturin and zig, which links against an old glibc, and
# cargo-deb. For another processor also qemu-user-static and its C library (Debian: libc6-arm64-cross).
set -euo pipefail
cd "$(dirname "$0")/.."
target="$(cargo metadata --no-deps --format-version 1 | python3 -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')"
tools="$target/packaging" profile="${PROFILE:-dist}"
version="$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)"
host="$(rustc -vV | sed -n 's/^host: //p')"
triple="${1:-$host}"
machine="${triple%%-*}"
out="$target/packages"
if [ "$triple" != "$host" ]; then
  out="$out-$machine" emulator="qemu-$machine-static" libraries="/usr/${triple/-unknown/}"
  command -v "$emulator" > /dev/null && [ -d "$libraries" ] || {
    echo "$emulator, $libraries: missing; install qemu-user-static and the C library for $triple" >&2
    exit 1
  }
  export "CARGO_TARGET_$(tr a-z- A-Z_ <<< "$triple")_RUNNER=$emulator -L $libraries"
  rustup --quiet target add "$triple"
fi
rm -rf "$out" && mkdir -p "$out"
packaging/wheel.sh "$out" "$profile" "$triple"

if ! "$tools/bin/cargo-deb" --version 2> /dev/null | grep -q 3.8.0; then
  cargo install --quiet --locked --root "$tools" --target-dir "$tools/cargo-deb" cargo-deb --version 3.8.0
fi
export PATH="$tools/bin:$PATH"
cargo deb --quiet --no-build --no-strip --profile "$profile" --target "$triple" --output "$out/"

program="$target/$triple/$profile/svl" share=packaging/svl.data/data/share
tar="$tools/svl-$version-$machine-linux"
rm -rf "$tar" && mkdir -p "$tar/bin"
cp "$program" "$tar/bin/"
cp -r "$share" "$tar/"
tar -C "$tools" --owner=0 --group=0 --mode=u=rwX,go=rX -czf "$out/$(basename "$tar").tar.gz" "$(basename "$tar")"

ls -l "$program" "$out"
size="$(stat -c %s "$program")"
[ "$profile" != dist ] || [ "$size" -le 60000000 ] || { echo "the program has $size bytes, more than 60 MB" >&2; exit 1; }
packaging/check.sh "$out"
