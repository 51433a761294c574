#!/usr/bin/env bash
# Builds the packages: the wheel (packaging/wheel.sh), and with the C library a Debian package and a tar for any Linux with
# glibc 2.31 or later (Debian 11, Ubuntu 20.04). Then packaging/check.sh tries them. On two cores it takes half an hour.
#
#   packaging/build.sh                             # for this machine, into target/packages
#   packaging/build.sh aarch64-unknown-linux-gnu   # for ARM boards, into target/packages-aarch64
#   PROFILE=release packaging/build.sh             # a quick try: larger and slower programs
#
# Needs Rust, Python with venv, and the network for its tools: those of packaging/tools.sh, and cargo-deb. For another processor also qemu-user-static and its C library (Debian: libc6-arm64-cross).
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
for program in debootstrap readelf; do
  command -v "$program" > /dev/null || {
    echo "$program: missing; packaging/check.sh needs it: apt-get install debootstrap binutils" >&2
    exit 1
  }
done
rm -rf "$out" && mkdir -p "$out"
packaging/wheel.sh "$out" "$profile" "$triple"

if ! "$tools/bin/cargo-deb" --version 2> /dev/null | grep -q 3.8.0; then
  cargo install --quiet --locked --root "$tools" --target-dir "$tools/cargo-deb" cargo-deb --version 3.8.0 || {
    echo "cargo-deb: missing; once with a network: cargo install --root $tools cargo-deb --version 3.8.0" >&2
    exit 1
  }
fi
export PATH="$tools/bin:$PATH"
library=packaging/c.data
rm -rf "$library"
SVL_CARGO=cargo-zigbuild src/c/install.sh "$library" --profile "$profile" --target "$triple.2.31"
cargo deb --quiet --no-build --no-strip --profile "$profile" --target "$triple" --output "$out/"

program="$target/$triple/$profile/svl" share=packaging/svl.data/data/share
tar="$tools/svl-$version-$machine-linux"
rm -rf "$tar" && mkdir -p "$tar/bin"
cp "$program" "$tar/bin/"
cp -a "$share" "$library"/* "$tar/"
tar -C "$tools" --owner=0 --group=0 --mode=u=rwX,go=rX -czf "$out/$(basename "$tar").tar.gz" "$(basename "$tar")"

# Each package has the notices of all crates.
crates="$(cargo tree --locked -e normal -p svl -p svl-python -p svl-c --target "$triple" --prefix none --format '{p}' |
  awk 'NF && $1 !~ /^svl(-|$)/ { print $1, $2 }' | sort -u | wc -l)"
counted() {
  local found
  found="$(grep -c '; https://crates\.io/crates/' || true)"
  [ "$found" = "$crates" ] || { echo "$1: notices of $found crates, cargo tree has $crates" >&2; exit 1; }
}
notices=share/doc/svl/THIRD-PARTY-NOTICES.txt
dpkg-deb --fsys-tarfile "$out"/svl_*.deb | tar -xO "./usr/$notices" | counted deb
tar -xzOf "$out"/svl-*.tar.gz "$(basename "$tar")/$notices" | counted tar
python3 -m zipfile -e "$out"/svl_bench-*.whl "$tools/unpacked"
cat "$tools"/unpacked/svl_bench-*.dist-info/licenses/made/licences/THIRD-PARTY-NOTICES.txt | counted wheel
rm -r "$tools/unpacked"

ls -l "$program" "$out"
size="$(stat -c %s "$program")"
[ "$profile" != dist ] || [ "$size" -le 60000000 ] || { echo "the program has $size bytes, more than 60 MB" >&2; exit 1; }
packaging/check.sh "$out"
