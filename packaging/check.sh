#!/usr/bin/env bash
# Installs each package of the folder $1 into a clean Debian 11 (glibc 2.31) and runs the main job there. As root, or by
# sudo, with debootstrap, binutils and the network. Packages for another processor are unpacked into a Debian 11 for that
# one, whose installers do not run here, and svl runs in it under qemu: that needs qemu-user-static and python3-pip, too.
set -euo pipefail
[ "$(id -u)" = 0 ] || exec sudo "$0" "$@"
packages="$(realpath "$1")" repository="$(realpath "$(dirname "$0")/..")"
notebook="$repository/examples/python/report.ipynb" examples="$repository/src/c/examples"
deb="$(echo "$packages"/svl_*.deb)" tar="$(echo "$packages"/svl-*.tar.gz)" wheel="$(echo "$packages"/svl_bench-*.whl)"
root="$(mktemp -d)"
trap 'rm -rf "$root"' EXIT
architecture="$(dpkg-deb -f "$deb" Architecture)"
machine="$(basename "$tar" -linux.tar.gz)" && machine="${machine##*-}"
if [ "$architecture" = "$(dpkg --print-architecture)" ]; then
  how=install frames=40 emulator=() debian=("--include=python3-pip,python3-numpy,man-db,g++,cmake,make,pkg-config")
else
  how=unpack frames=6 emulator=("/usr/bin/qemu-$machine-static")
  debian=(--include=python3-numpy --foreign "--arch=$architecture")
fi
debootstrap --variant=minbase "${debian[@]}" bullseye "$root/clean" > "$root/log" || { tail "$root/log"; exit 1; }
if [ "$how" = unpack ]; then
  cp "${emulator[0]}" "$root/clean/usr/bin/"
  mkdir -p "$root/clean/usr/local/bin"
  # debootstrap has fetched Python and its libraries, which need no installer here.
  for package in "$root"/clean/var/cache/apt/archives/*.deb; do dpkg-deb -x "$package" "$root/clean"; done
fi

inside() { env -i PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin HOME=/root LANG=C.UTF-8 chroot "$place" "$@"; }
svl() { inside "${emulator[@]}" "$program" "$@"; }

# Depths of a textured plane of 9 px, by the extension for this processor.
python_matches() {
  "$@" -c '
import numpy as np, svl_bench as svl, svl_bench.matcher
noise = np.random.default_rng(7).integers(0, 256, (240, 400), np.uint8)
rig = svl.Rig(focal_px=328, baseline_m=0.044, cx_px=160, cy_px=120)
found = svl.match(noise[:, :320], noise[:, 9:329], "v3", rig=rig)
assert abs(np.nanmedian(found.distance_m) - 328 * 0.044 / 9) < 0.05, found.distance_m
print("svl_bench", svl.__version__, svl.instruction_set())
'
}
install_wheel() {
  inside bash -euc 'pip3 -q install --no-index /tmp/svl_bench-*.whl'
  inside python3 -c "import svl_bench; svl_bench.program()"
  python_matches inside python3
  # The notebook of the documents, from top to bottom.
  # pip takes conditions on the version for those of the Python here: what 3.9 needs besides is named.
  python3 -m pip -q download --only-binary :all: --python-version 3.9 --platform "manylinux2014_$machine" \
    --dest "$place/tmp/wheels" matplotlib importlib-resources zipp
  inside pip3 -q install --no-index --find-links /tmp/wheels matplotlib
  cp "$notebook" "$place/tmp/"
  inside env MPLBACKEND=Agg python3 -c '
import json, os
os.makedirs("/root/notebook")
os.chdir("/root/notebook")
names = {}
for cell in json.load(open("/tmp/report.ipynb"))["cells"]:
    if cell["cell_type"] == "code":
        exec("".join(cell["source"]), names)
'
  test -s "$place/root/notebook/reports/run/index.html" -a -s "$place/root/notebook/distances.svg"
}
install_deb() { inside bash -euc 'dpkg -i /tmp/svl_*.deb'; }
install_tar() { inside bash -euc 'tar -C /usr/local --strip-components 1 -xzf /tmp/svl-*.tar.gz'; }
unpack_wheel() {
  python3 -m pip -q install --no-index --no-deps --only-binary :all: --platform "manylinux_2_31_$machine" \
    --target "$place/opt" "$wheel"
  mv "$place/opt/bin/svl" "$place/usr/local/bin/"
  local libraries="/usr/lib/$machine-linux-gnu"
  python_matches inside "${emulator[@]}" -E PYTHONPATH=/opt -E "LD_LIBRARY_PATH=$libraries/blas:$libraries/lapack" \
    /usr/bin/python3.9
}
unpack_deb() { dpkg-deb -x "$deb" "$place"; }
unpack_tar() { tar -C "$place/usr/local" --strip-components 1 -xzf "$tar"; }

# A program in C++ of the C library, as pkg-config and CMake find it.
links_library() {
  cp "$examples/stop.cpp" "$place/tmp/"
  cat > "$place/tmp/CMakeLists.txt" << 'CMAKE'
cmake_minimum_required(VERSION 3.13)
project(stop CXX)
find_package(svl 0.1 REQUIRED)
add_executable(stop stop.cpp)
target_link_libraries(stop svl::svl)
CMAKE
  # shellcheck disable=SC2016
  inside bash -euc '
    ldconfig && cd /tmp
    c++ -std=c++11 -Wall -Werror stop.cpp $(pkg-config --cflags --libs svl) -o pkg-config-stop && ./pkg-config-stop > one
    cmake -S . -B build > /dev/null && cmake --build build > /dev/null && build/stop > two
    cmp one two && test -s one'
}
depends="$(dpkg-deb -f "$deb" Depends)"
[ "$depends" = "libc6 (>= 2.31)" ] || { echo "the Debian package depends on $depends" >&2; exit 1; }
# In a fresh copy.
for package in wheel deb tar; do
  place="$root/$package"
  cp -a "$root/clean" "$place"
  cp "$packages"/* "$place/tmp/"
  "${how}_$package"
  program=/usr/bin/svl
  [ -e "$place$program" ] || program=/usr/local/bin/svl
  glibc="$(readelf -W --version-info "$place$program" | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -1)"
  [ "$(printf '%s\n' "$glibc" GLIBC_2.31 | sort -V | tail -1)" = GLIBC_2.31 ] || { echo "it needs $glibc" >&2; exit 1; }
  svl --version
  if [ "$how" = install ]; then
    inside man -w svl
    documents="$place${program%/bin/svl}/share/doc/svl"
    for file in README.md THIRD-PARTY-NOTICES.txt svl.cdx.json; do test -s "$documents/$file"; done
    inside sh -c 'ls /usr/share/bash-completion/completions/svl /usr/local/share/bash-completion/completions/svl 2> /dev/null || true'
    [ "$package" = wheel ] || links_library
  fi
  svl -q record --frames "$frames" -o /root/run.mcap
  svl info /root/run.mcap
  svl -q replay /root/run.mcap --algo v5 --rerun /root/run.rrd --rows /root/rows.csv
  svl replay /root/run.mcap --algo v5 --verify=/root/rows.csv
  svl -q score /root/run.mcap --algo v3 --algo v5 -o /root/report
  test -s "$place/root/report/index.html" -a -s "$place/root/run.rrd"
  svl algos exec --example cpp > "$place/root/svl_matcher.hpp"
  echo "== $package for $architecture: well, with $glibc"
  rm -rf "$place"
done
