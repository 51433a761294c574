#!/usr/bin/env bash
# Collects what a release consists of, after packaging/build.sh for both processors: the packages, with the wheel for macOS
# if target/packages-macos has one, their checksums (SHA256SUMS), and the version's section of CHANGELOG.md (notes.md).
#
#   packaging/release.sh v0.1.0           # into target/release-v0.1.0
#   packaging/release.sh v0.1.0 --check   # may it be released? Before the hours of building.
set -euo pipefail
cd "$(dirname "$0")/.."
target="$(cargo metadata --no-deps --format-version 1 | python3 -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')"
version="$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)"
tag="${1:?usage: packaging/release.sh vVERSION}"
[ "$tag" = "v$version" ] || { echo "$tag: Cargo.toml has the version $version" >&2; exit 1; }
repository="$(sed -n 's/^repository = "\(.*\)"/\1/p' Cargo.toml)"
case "$repository" in
  *OWNER*) echo "repository = \"$repository\" is a placeholder: write the address into Cargo.toml" >&2; exit 1 ;;
esac
notes="$(awk -v version="$version" '/^## /{ on = $2 == version; next } on' CHANGELOG.md)"
[ -n "$notes" ] || { echo "CHANGELOG.md has no section $version: rename Unreleased (RELEASING.md)" >&2; exit 1; }
[ "${2:-}" != --check ] || exit 0

out="$target/release-$tag"
rm -rf "$out" && mkdir -p "$out"
for packages in "$target/packages" "$target/packages-aarch64"; do
  for kind in "svl_bench-$version-*.whl" "svl_$version-*.deb" "svl-$version-*.tar.gz"; do
    # shellcheck disable=SC2206
    files=("$packages"/$kind)
    [ -f "${files[0]}" ] || { echo "$packages: no $kind; packaging/build.sh makes it" >&2; exit 1; }
    cp "${files[@]}" "$out/"
  done
done
for wheel in "$target/packages-macos/svl_bench-$version"-*.whl; do
  [ ! -f "$wheel" ] || cp "$wheel" "$out/"
done
printf '%s\n' "$notes" > "$out/notes.md"
(cd "$out" && sha256sum -- *.whl *.deb *.tar.gz > SHA256SUMS && sha256sum --check SHA256SUMS)
