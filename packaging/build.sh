#!/usr/bin/env bash
# Builds the packages of the program: a wheel, a Debian package, and a tar for any Linux with glibc 2.31 or later (Debian
# 11, Ubuntu 20.04). Then packaging/check.sh tries them. On two cores it takes half an hour.
#
#   packaging/build.sh                             # for this machine, into target/packages
#   packaging/build.sh aarch64-unknown-linux-gnu   # for ARM boards, into target/packages-aarch64
#
# Needs Rust, Python with venv, and the network for its tools: maturin and zig, which links against an old glibc, and
# cargo-deb. For another processor also qemu-user-static and its C library (Debian: libc6-arm64-cross).
set -euo pipefail
cd "$(dirname "$0")/.."
target="$(cargo metadata --no-deps --format-version 1 | python3 -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')"
tools="$target/packaging"
version="$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)"
host="$(rustc -vV | sed -n 's/^host: //p')"
triple="${1:-$host}"
machine="${triple%%-*}"
out="$target/packages" emulator=()
if [ "$triple" != "$host" ]; then
  out="$out-$machine" emulator=("qemu-$machine-static" -L "/usr/${triple/-unknown/}")
  command -v "${emulator[0]}" > /dev/null && [ -d "${emulator[2]}" ] || {
    echo "${emulator[*]}: missing; install qemu-user-static and the C library for $triple" >&2
    exit 1
  }
  rustup --quiet target add "$triple"
fi
mkdir -p "$tools" && rm -rf "$out" && mkdir -p "$out"

if ! "$tools/bin/maturin" --version 2> /dev/null | grep -q 1.16.0; then
  python3 -m venv "$tools"
  "$tools/bin/pip" -q install maturin==1.16.0 ziglang==0.17.1
fi
if ! "$tools/bin/cargo-deb" --version 2> /dev/null | grep -q 3.8.0; then
  cargo install --quiet --locked --root "$tools" --target-dir "$tools/cargo-deb" cargo-deb --version 3.8.0
fi
export PATH="$tools/bin:$PATH"

# Man page and completions are the program's own, so it is built before the packages are.
beside="$PWD/packaging/svl.data/data"
rm -rf packaging/svl.data && mkdir -p "$beside/share/doc/svl" packaging/svl.data/scripts
cp README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$beside/share/doc/svl"
build() { maturin build --quiet --locked --zig --target "$triple" --compatibility manylinux_2_31 --profile dist "$@"; }
build --bindings bin --features ros2 -o "$tools/program"
program="$target/$triple/dist/svl"
mkdir -p "$beside"/share/{man/man1,bash-completion/completions,zsh/site-functions,fish/vendor_completions.d}
svl() { "${emulator[@]}" "$program" "$@"; }
svl generate man -o "$beside/share/man/man1"
svl generate completions bash > "$beside/share/bash-completion/completions/svl"
svl generate completions zsh > "$beside/share/zsh/site-functions/_svl"
svl generate completions fish > "$beside/share/fish/vendor_completions.d/svl.fish"
cp "$program" packaging/svl.data/scripts/
build --manifest-path src/python/Cargo.toml -o "$out"

cargo deb --quiet --no-build --no-strip --profile dist --target "$triple" --output "$out/"

tar="$tools/svl-$version-$machine-linux"
rm -rf "$tar" && mkdir -p "$tar/bin"
cp "$program" "$tar/bin/"
cp -r "$beside/share" "$tar/"
tar -C "$tools" -czf "$out/$(basename "$tar").tar.gz" "$(basename "$tar")"

ls -l "$program" "$out"
size="$(stat -c %s "$program")"
[ "$size" -le 60000000 ] || { echo "the program has $size bytes, more than 60 MB" >&2; exit 1; }
packaging/check.sh "$out"
