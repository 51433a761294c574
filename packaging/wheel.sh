#!/usr/bin/env bash
# Builds the wheel svl-bench: the program, its man page and completions, the Python package svl_bench, and the licences and
# the bill of materials of all that is linked. It runs on Linux and macOS.
#
#   packaging/wheel.sh OUT                                  # for this machine, in the profile release
#   packaging/wheel.sh OUT dist aarch64-unknown-linux-gnu   # for Linux with glibc 2.31 or later, linked by zig
#
# Needs Rust and Python; packaging/tools.sh fetches maturin and zig where `maturin` is not installed. For another processor
# CARGO_TARGET_<TRIPLE>_RUNNER names the emulator, as cargo's documentation says.
set -euo pipefail
mkdir -p "${1:?usage: packaging/wheel.sh OUT [PROFILE [TRIPLE]]}"
out="$(cd "$1" && pwd)"
cd "$(dirname "$0")/.."
profile="${2:-release}" triple="${3:-}"
python="${SVL_PYTHON:-python3}"
target="$(cargo metadata --no-deps --format-version 1 | "$python" -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')"

if [ -n "$triple" ] || ! "$python" -m maturin --version > /dev/null 2>&1; then
  tools="$(packaging/tools.sh)"
  python="$tools/bin/python"
  export PATH="$tools/bin:$PATH"
fi
options=(--quiet --locked --profile "$profile") runner=()
if [ -n "$triple" ]; then
  options+=(--zig --target "$triple" --compatibility manylinux_2_31)
  name="CARGO_TARGET_$(tr a-z- A-Z_ <<< "$triple")_RUNNER"
  read -ra runner <<< "${!name:-}"
fi
build() { "$python" -m maturin build "${options[@]}" "$@"; }

# Man page and completions are the program's own, so it is built first.
build --bindings bin -o "$target/packaging/program"
program="$target/${triple:+$triple/}$profile/svl"
data=packaging/svl.data share=packaging/svl.data/data/share
rm -rf "$data"
mkdir -p "$data/scripts" "$share"/{doc/svl,man/man1,bash-completion/completions,zsh/site-functions,fish/vendor_completions.d}
documents="$share/doc/svl" made=src/python/made
cp CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$documents"
# Links of the README lead into the repository: it is the page of the package, too.
version="$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)"
repository="$(sed -n 's/^repository = "\(.*\)"/\1/p' Cargo.toml)"
sed -E "s|(!\[[^]]*\]\()([a-zA-Z])|\1$repository/raw/v$version/\2|; t
  s|\]\(([a-zA-Z]+[^:)]*\))|]($repository/blob/v$version/\1|g" README.md > "$documents/README.md"
"$python" packaging/notices.py "$documents" "${triple:-$(rustc -vV | sed -n 's/^host: //p')}"
rm -rf "$made" && mkdir -p "$made/licences"
cp "$documents"/{README.md,svl.cdx.json} "$made"
cp "$documents"/{LICENSE-MIT,LICENSE-APACHE,THIRD-PARTY-NOTICES.txt} "$made/licences"
generate() { ${runner[@]+"${runner[@]}"} "$program" generate "$@"; }
generate man -o "$share/man/man1"
generate completions bash > "$share/bash-completion/completions/svl"
generate completions zsh > "$share/zsh/site-functions/_svl"
generate completions fish > "$share/fish/vendor_completions.d/svl.fish"
cp "$program" "$data/scripts/"
build --manifest-path src/python/Cargo.toml -o "$out"
