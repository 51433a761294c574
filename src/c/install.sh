#!/usr/bin/env bash
# Builds the C library and installs it: the header, the static and the shared library, and the files with which pkg-config
# (`svl`) and CMake (`find_package(svl)`, targets svl::svl and svl::static) find them. The folder can be moved.
#
#   src/c/install.sh /usr/local && ldconfig                                   # as root
#   src/c/install.sh robot/svl --release --target aarch64-unknown-linux-gnu   # more arguments are cargo's
#
# SVL_CARGO names another cargo: packaging/build.sh takes cargo-zigbuild, for an old glibc.
set -euo pipefail
[ $# -gt 0 ] || { echo "usage: src/c/install.sh PREFIX [arguments of cargo, default --release]" >&2; exit 2; }
mkdir -p "$1"
prefix="$(CDPATH="" cd -- "$1" && pwd)" && shift
[ $# -gt 0 ] || set -- --release
cd "$(dirname "$0")"

version="$(cargo pkgid --quiet)" && version="${version##*[#@]}"
# Minor versions of 0.x may break programs.
abi="${version%%.*}" && [ "$abi" != 0 ] || abi="${version%.*}"
built="$("${SVL_CARGO:-cargo}" rustc --quiet --locked --lib --crate-type cdylib,staticlib --message-format json-render-diagnostics "$@" \
  -- -C "link-arg=-Wl,-soname,libsvl.so.$abi" | grep -o '"[^"]*/libsvl_c\.\(a\|so\)"' | tr -d '"' | sort -u)"
library() { grep -m 1 "\.$1\$" <<< "$built"; }

install -d "$prefix/include" "$prefix"/lib/{pkgconfig,cmake/svl}
install -m 644 include/svl.h "$prefix/include/"
install -m 644 "$(library a)" "$prefix/lib/libsvl.a"
install -m 755 "$(library so)" "$prefix/lib/libsvl.so.$version"
ln -sf "libsvl.so.$version" "$prefix/lib/libsvl.so.$abi"
ln -sf "libsvl.so.$abi" "$prefix/lib/libsvl.so"
for file in pkgconfig/svl.pc cmake/svl/svl-config.cmake cmake/svl/svl-config-version.cmake; do
  sed -e "s/@VERSION@/$version/g" -e "s/@ABI@/$abi/g" "find/${file##*/}" > "$prefix/lib/$file"
done
