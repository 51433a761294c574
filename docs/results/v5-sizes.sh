#!/usr/bin/env bash
# v5 and sgm by the size of the images (docs/results/v5.md): bash docs/results/v5-sizes.sh
# Seeds that nothing was fitted to; the range of disparities is a quarter of the width. The reports stay in
# reports/v5-sizes-*. Prints right, wrong and unknown cells, found near obstacles, and predicted minus right.
set -euo pipefail
cd "$(dirname "$0")/../.."
svl="${SVL:-target/release/svl}"
[ -n "${SVL:-}" ] || cargo build --release --quiet --locked
mkdir -p reports/v5-sizes
for run in "arena 320 301..303 7" "arena 640 301..303 7" "arena 960 301..303 14" "worlds 320 8101..8106 2" \
  "worlds 640 8101..8106 2" "worlds 960 8111..8113 4" "shapes 320 8101..8106 2" "shapes 640 8101..8106 2" \
  "shapes 960 8111..8113 4"; do
  read -r kind width seeds every <<< "$run"
  scenario="reports/v5-sizes/$kind-$width.toml"
  sed "s/width_px = 320/width_px = $width/; s/height_px = 240/height_px = $((width * 3 / 4))/" \
    "scenarios/$kind.toml" > "$scenario"
  range=$((width / 4))
  "$svl" score "$scenario" --algo "v5:max_disparity=$range" --algo "sgm:max_disparity=$range" --seeds "$seeds" \
    --every "$every" --rerun none --quiet --force -o "reports/v5-sizes-$kind-$width" > /dev/null
  python3 - "reports/v5-sizes-$kind-$width" "$kind $width" << 'PYTHON'
import collections, csv, sys

folder, name = sys.argv[1:]
cells, near = collections.defaultdict(list), collections.defaultdict(collections.Counter)
for row in csv.DictReader(open(f"{folder}/cells.csv")):
    if row["verdict"] != "no-truth":
        cells[row["algorithm"]].append(row)
for row in csv.DictReader(open(f"{folder}/rows.csv")):
    for key in ("found_obstacles", "near"):
        near[row["algorithm"]][key] += int(float(row[key] or 0))
for algorithm, rows in cells.items():
    count = collections.Counter(row["verdict"] for row in rows)
    known = [row for row in rows if row["verdict"] in ("right", "wrong")]
    said = [float(row["probability"]) for row in known if row["probability"]]
    off = f"{100 * (sum(said) / len(said) - count['right'] / len(known)):+.1f}" if said else ""
    of = near[algorithm]
    print(f"| {name} {algorithm} | {count['right']} / {count['wrong']} / {len(rows) - len(known)} | "
          f"{100 * count['wrong'] / len(known):.2f} | {of['found_obstacles']} of {of['near']} | {off} |")
PYTHON
done
