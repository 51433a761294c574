#!/usr/bin/env bash
# v5 beside matchers that were built for the same question (docs/results/rivals.md): bash docs/rivals.sh DATASETS
# Prints, for each set of scenes, right and wrong cells and missed and false obstacles of v5 (revisions 2 and 3),
# pushbroom, and v3, bm and sgm with the median of each cell and with that of its stixels; then the drives. The reports
# stay in reports/rivals-*.
set -euo pipefail
datasets="$(realpath "${1:?the folder of the data sets}")"
cd "$(dirname "$0")/.."
svl() { cargo run --profile "${PROFILE:-release}" --quiet --locked -- "$@"; }
mkdir -p reports

# The scenario, with that decision.
with() {
  if grep -q '^\[grid\]' "$2"; then
    sed "s/^\[grid\]/[grid]\ndecision = \"$1\"/" "$2"
  else
    sed "s/^\[source\]/[grid]\ndecision = \"$1\"\n\n[source]/" "$2"
  fi > "reports/rivals-$1.toml"
}
own=(--algo v5 --algo v5:revision=3 --algo pushbroom)
dense=(--algo v3 --algo bm --algo sgm)
score() {
  local name="$1" scenario="$2"
  shift 2
  for decision in median stixels; do
    with "$decision" "$scenario"
    [ "$decision" = median ] && algorithms=("${own[@]}" "${dense[@]}") || algorithms=("${dense[@]}")
    svl score "reports/rivals-$decision.toml" "${algorithms[@]}" "$@" --quiet \
      -o "reports/rivals-$name-$decision" > /dev/null
  done
}

score arena scenarios/arena.toml --seeds 31..33 --rerun none
score worlds scenarios/worlds.toml --seeds 2001..2020 --rerun none
score shapes scenarios/shapes.toml --seeds 2001..2020 --rerun none
score middlebury scenarios/middlebury.toml --data "$datasets" --rerun none
score playground scenarios/eth3d.toml --data "$datasets" --scenes eth3d-playground_1l --rerun none
score street scenarios/kitti2012.toml --data "$datasets" --scenes kitti2012-000000_10 --rerun none
score drives scenarios/drive.toml --drives none --seeds "${COURSES:-1001..1020}"

python3 - << 'PYTHON'
import collections
import csv

SETS = {name: [name] for name in ("arena", "worlds", "shapes", "middlebury")}
SETS["two real pairs"] = ["playground", "street"]
for name, parts in SETS.items():
    counts = collections.defaultdict(collections.Counter)
    for part in parts:
        for decision in ("median", "stixels"):
            for row in csv.DictReader(open(f"reports/rivals-{part}-{decision}/cells.csv")):
                if row["verdict"] != "no-truth":
                    of = counts[row["algorithm"] + (", stixels" if decision == "stixels" else "")]
                    of[row["verdict"]] += 1
                    of["all"] += 1
                    of["missed"] += row["missed_obstacle"] == "true"
                    of["false"] += row["false_obstacle"] == "true"
    print(f"\n{name}\n\n| algorithm | right / wrong, % of the cells | missed / false obstacles |\n|---|---:|---:|")
    for algorithm, of in counts.items():
        right, wrong = (100 * of[verdict] / of["all"] for verdict in ("right", "wrong"))
        print(f"| {algorithm} | {right:.1f} / {wrong:.2f} | {of['missed']} / {of['false']} |")
print("\ndrives\n\n| algorithm | courses | finished, % | collisions | near misses | driven, m |\n|---|---:|---:|---:|---:|---:|")
for decision in ("median", "stixels"):
    sums = collections.defaultdict(collections.Counter)
    for row in csv.DictReader(open(f"reports/rivals-drives-{decision}/drives.csv")):
        of = sums[row["algorithm"] + (", stixels" if decision == "stixels" else "")]
        of["courses"] += 1
        of["finished"] += row["finished"] == "true"
        for key in ("collisions", "near_misses", "driven_m"):
            of[key] += float(row[key])
    for algorithm, of in sums.items():
        print(f"| {algorithm} | {of['courses']} | {100 * of['finished'] / of['courses']:.0f} | {of['collisions']:.0f} | "
              f"{of['near_misses']:.0f} | {of['driven_m']:.0f} |")
PYTHON
