#!/usr/bin/env bash
# Regenerates the tables of docs/results: bash docs/results/tables.sh DATASETS
# The lines between `<!-- NAME -->` and `<!-- end -->` are the output of the command of that name.
set -euo pipefail
cd "$(dirname "$0")/../.."
datasets="${1:?the folder of the data sets}"
svl() { cargo run --release --quiet --locked -- "$@"; }

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
svl score scenarios/arena.toml --quiet >/dev/null
svl score scenarios/middlebury.toml --data "$datasets" --quiet >/dev/null
table() { awk -v want="$2" '/^\|/ { if (!inside) n++; inside = 1; if (n == want) print; next } { inside = 0 }' "$1"; }
# Columns that a page has room for; the report has all.
columns() { awk -F'|' -v want="$1" 'NR == 1 { for (i = 2; i < NF; i++) if ($i ~ want) keep[i] }
  { line = "|"; for (i = 2; i < NF; i++) if (i in keep) line = line $i "|"; print line }'; }
# Of checkpoints, the frames that pass alone.
fractions() { grep -v ' 0/6 0/6 ' | sed 's/| [✓✗]* /| /g; s,[0-9]*/[0-9]* ,,g'; }
table reports/arena/summary.md 2 |
  columns ' algorithm $|obstacle cells, %: (right|wrong)|obstacles: (missed|false)|p50' >"$work/arena"
table reports/arena/summary.md 3 | fractions >"$work/checkpoints"
table reports/middlebury/summary.md 2 |
  columns ' algorithm $|: cover|[>]2 or none|[>][12] px|p50|^ cells, %: (right|wrong)' >"$work/middlebury"
{ echo '```text'; svl bench; echo '```'; } >"$work/bench"
# The run's manifest names day and processor.
entry() { sed -n "s/^ *\"$1\": *\"\{0,1\}\([^\",]*\).*/\1/p" reports/arena/manifest.json | head -1; }
echo "Measured on $(entry began | cut -c1-10), $(entry processor), $(entry isa), svl $(entry svl)" \
  "($(entry git_revision))." >"$work/machine"

for file in docs/results/*.md; do
  awk -v work="$work" '
    /^<!-- end -->$/ { skip = 0 }
    !skip { print }
    /^<!-- (arena|checkpoints|middlebury|bench|machine) -->$/ {
      print ""; while ((getline line < (work "/" $2)) > 0) print line; close(work "/" $2); print ""; skip = 1
    }' "$file" >"$work/page.md"
  cat "$work/page.md" >"$file"
done
