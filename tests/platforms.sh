#!/usr/bin/env bash
# Compiles svl for macOS and Windows without linking it, with all default features and with none: `cargo check`. Nothing runs.
# Build scripts compile C: for macOS by zig, which packaging/tools.sh fetches, for Windows by mingw.
#
#   tests/platforms.sh             # both
#   tests/platforms.sh x86_64-pc-windows-gnu
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- aarch64-apple-darwin x86_64-pc-windows-gnu
step() { printf '\n== %s (%ss)\n' "$*" "$SECONDS"; "$@"; }
for triple; do
  cargo="cargo-zigbuild"
  case "$triple" in
    *-windows-gnu)
      cargo=cargo
      command -v "${triple%%-*}-w64-mingw32-gcc" > /dev/null || {
        echo "mingw: missing; as root: apt-get install gcc-mingw-w64-${triple%%-*}" | tr _ - >&2
        exit 1
      } ;;
    *-apple-darwin)
      tools="$(packaging/tools.sh)"
      export PATH="$tools/bin:$PATH" ;;
    *) echo "$triple: neither macOS nor Windows" >&2; exit 2 ;;
  esac
  rustup --quiet target add "$triple" || {
    echo "Rust's standard library for $triple: missing; once with a network: rustup target add $triple" >&2
    exit 1
  }
  for features in "" --no-default-features; do
    # shellcheck disable=SC2086
    step "$cargo" check --locked --target "$triple" $features
  done
done
# The extension for Python: there is a wheel for macOS.
case " $* " in *-apple-darwin*) step cargo-zigbuild check --locked --target aarch64-apple-darwin -p svl-python ;; esac
