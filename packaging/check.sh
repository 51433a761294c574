#!/usr/bin/env bash
# Installs each package of the folder $1 into a clean Debian 11 (glibc 2.31) and runs the main job there. As root, or by
# sudo, with debootstrap (Debian: apt-get install debootstrap).
set -euo pipefail
[ "$(id -u)" = 0 ] || exec sudo "$0" "$@"
packages="$(realpath "$1")"
root="$(mktemp -d)"
trap 'rm -rf "$root"' EXIT
debootstrap --variant=minbase --include=python3-pip,python3-numpy,man-db bullseye "$root/clean" > "$root/log" || { tail "$root/log"; exit 1; }

# In a fresh copy: $1 is its name, $2 what installs svl.
try() {
  cp -a "$root/clean" "$root/$1"
  cp "$packages"/* "$root/$1/tmp/"
  chroot "$root/$1" env -i PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin HOME=/root LANG=C.UTF-8 bash -euc "
    cd /tmp
    $2
    svl --version
    man -w svl
    ls /usr/share/bash-completion/completions/svl /usr/local/share/bash-completion/completions/svl 2> /dev/null || true
    cd /root
    svl -q record --frames 40 -o run.mcap
    svl -q replay run.mcap --algo v5 --rerun run.rrd
    svl -q score run.mcap --algo v3 --algo v5 -o report
    test -s report/index.html -a -s run.rrd
    svl algos exec --example cpp > svl_matcher.hpp
  "
  echo "== $1: well"
  rm -rf "${root:?}/$1"
}
try wheel 'pip3 -q install --no-index svl_bench-*.whl && python3 -c "import svl_matcher"'
try deb 'dpkg -i svl_*.deb'
try tar 'tar -C /usr/local --strip-components 1 -xzf svl-*.tar.gz'
