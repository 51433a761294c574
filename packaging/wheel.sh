#!/usr/bin/env bash
# Builds the wheel svl-bench: the program, its man page and completions, and the Python package svl_bench.
#
#   packaging/wheel.sh OUT                                  # for this machine, in the profile release
#   packaging/wheel.sh OUT dist aarch64-unknown-linux-gnu   # for Linux with glibc 2.31 or later, linked by zig
#
# Needs Rust and Python; maturin and zig are fetched where `maturin` is not installed. For another processor
# CARGO_TARGET_<TRIPLE>_RUNNER names the emulator, as cargo's documentation says.
set -euo pipefail
out="$(realpath -m "${1:?usage: packaging/wheel.sh OUT [PROFILE [TRIPLE]]}")"
cd "$(dirname "$0")/.."
profile="${2:-release}" triple="${3:-}"
python="${SVL_PYTHON:-python3}"
target="$(cargo metadata --no-deps --format-version 1 | "$python" -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')"

if [ -n "$triple" ] || ! "$python" -m maturin --version > /dev/null 2>&1; then
  tools="$target/packaging" python="$tools/bin/python"
  if ! "$python" -m maturin --version 2> /dev/null | grep -q 1.16.0; then
    "${SVL_PYTHON:-python3}" -m venv "$tools"
    "$tools/bin/pip" -q install maturin==1.16.0 ziglang==0.17.1
  fi
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
cp README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$share/doc/svl"
generate() { "${runner[@]}" "$program" generate "$@"; }
generate man -o "$share/man/man1"
generate completions bash > "$share/bash-completion/completions/svl"
generate completions zsh > "$share/zsh/site-functions/_svl"
generate completions fish > "$share/fish/vendor_completions.d/svl.fish"
cp "$program" "$data/scripts/"
build --manifest-path src/python/Cargo.toml -o "$out"
