#!/usr/bin/env bash
# The tables of v5 for small cells and their nearer surfaces, and for several sizes of images:
# bash docs/results/v5-train.sh [small]
# Writes reports/v5-train/small.safetensors, two minutes, then v5.safetensors beside it, which has all of these tables;
# network and tables of small images are the built-in ones.
set -euo pipefail
cd "$(dirname "$0")/../.."
svl="$(realpath "${SVL:-target/release/svl}")"
[ -n "${SVL:-}" ] || cargo build --release --quiet --locked
mkdir -p reports/v5-train
scenarios="$(pwd)/scenarios"
cd reports/v5-train
# scenario KIND WIDTH RULE CELLS: the training scenario of that kind, in a file of those names
scenario() {
  local base="$1-training" frames="6\nrate_hz = 0.5" seeds=41..52 tolerance=""
  [ "$1" != boards ] || base=shapes-training
  [ "$1" != arena ] || frames="10\nrate_hz = 0.35"
  [ "$3" != narrow ] || { seeds=61..66; tolerance=$'tolerance_m = 0.02\ntolerance_percent = 5.0'; }
  [ "$4" = 5x3 ] || case "$3" in wide) seeds=41..66 ;; narrow) seeds=67..78 ;; esac
  {
    sed -e "/^\[grid\]/,/^$/d" -e "/^\[cells\]/,/^$/d" -e "/^\[arena.rig\]/,/^$/d" -e "/^rate_hz/d" \
      -e "s/^name = .*/name = \"$1-$2\"/" -e "s/^seeds = .*/seeds = \"$seeds\"/" \
      -e "s/^frames = .*/frames = $frames/" -e "s/^random = \"shapes\"/random = \"${1/arena/shapes}\"/" \
      "$scenarios/$base.toml"
    printf '\n[arena.rig]\nwidth_px = %d\nheight_px = %d\n' "$2" $(($2 * 3 / 4))
    printf '[grid]\ncolumns = %d\nrows = %d\n' "${4%x*}" "${4#*x}"
    printf '[cells]\njudge = "distance"\n%s\n' "$tolerance"
  } > "$1-$2-$3-$4.toml"
  echo "$1-$2-$3-$4.toml"
}
# all CELLS "KIND..." WIDTH...
all() {
  local cells="$1" kinds="$2"
  shift 2
  for width in "$@"; do for kind in $kinds; do for rule in wide narrow; do
    scenario "$kind" "$width" $rule "$cells"
  done; done; done
}
# Boards and larger images make tables of small cells too sure at 320 px.
# shellcheck disable=SC2046
"$svl" train v5 $(all 24x12 "arena worlds shapes" 320) --tables-only -o small.safetensors --force
[ "${1:-}" = small ] && exit
# shellcheck disable=SC2046
"$svl" train v5 $(all 5x3 "arena worlds shapes boards" 640 960) --tables-only \
  --algo v5:model=small.safetensors,max_disparity=160 -o v5.safetensors --force
