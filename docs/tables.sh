#!/usr/bin/env bash
# Makes the README's tables anew: bash docs/tables.sh DATASETS
# Between `<!-- NAME -->` and `<!-- end -->` stands what the command of that name printed.
set -euo pipefail
cd "$(dirname "$0")/.."
datasets="${1:?the folder of the data sets}"
svl() { cargo run --release --quiet -- "$@"; }

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
svl score scenarios/arena.toml --quiet >/dev/null
svl score scenarios/middlebury.toml --data "$datasets" --quiet >/dev/null
table() { awk -v want="$2" '/^\|/ { if (!inside) n++; inside = 1; if (n == want) print; next } { inside = 0 }' "$1"; }
table reports/arena/summary.md 1 >"$work/arena"
table reports/arena/summary.md 2 >"$work/checkpoints"
table reports/middlebury/summary.md 1 >"$work/middlebury"
{ echo '```text'; svl bench; echo '```'; } >"$work/bench"

awk -v work="$work" '
  /^<!-- end -->$/ { skip = 0 }
  !skip { print }
  /^<!-- (arena|checkpoints|middlebury|bench) -->$/ {
    print ""; while ((getline line < (work "/" $2)) > 0) print line; print ""; skip = 1
  }' README.md >"$work/README.md"
cat "$work/README.md" >README.md
