#!/usr/bin/env bash
# v5 beside v3, bm and sgm, for docs/results/rivals.md: bash docs/results/rivals.sh DATASETS
# Prints, for each set of scenes, of v5, v3, bm and sgm: right and wrong cells of obstacles, missed and
# false near obstacles, and wrong cells of the known ones with their 95 % interval (bootstrap over the seeds); then the
# drives. The reports stay in reports/rivals-*.
set -euo pipefail
datasets="$(realpath "${1:?the folder of the data sets}")"
cd "$(dirname "$0")/../.."
svl() { cargo run --profile "${PROFILE:-release}" --quiet --locked -- "$@"; }
algorithms=(--algo v5 --algo v3 --algo bm --algo sgm)
score() {
  local name="$1"
  shift
  svl score "$@" "${algorithms[@]}" --quiet -o "reports/rivals-$name" > /dev/null
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
import random

SETS = {name: [name] for name in ("arena", "worlds", "shapes", "middlebury")}
SETS["two real pairs"] = ["playground", "street"]
for name, parts in SETS.items():
    counts = collections.defaultdict(lambda: collections.defaultdict(collections.Counter))
    near = collections.defaultdict(collections.Counter)
    for part in parts:
        for row in csv.DictReader(open(f"reports/rivals-{part}/cells.csv")):
            of = counts[row["algorithm"]][row["seed"]]
            of["false"] += row["false"] == "true"
            if row["verdict"] != "no-truth" and row["area"] in ("obstacle", "pixels"):
                of[row["verdict"]] += 1
                of["all"] += 1
        for row in csv.DictReader(open(f"reports/rivals-{part}/summary.csv")):
            near[row["algorithm"]].update({key: int(row[key] or 0) for key in ("missed", "near", "found_obstacles")})
    print(f"\n{name}\n\n| algorithm | right / wrong, % of the cells | false obstacles | near ones found, % | missed "
          "| wrong, % of the known |\n|---|---:|---:|---:|---:|---:|")
    for algorithm, seeds in counts.items():
        of = sum(seeds.values(), collections.Counter())
        right, wrong = (100 * of[verdict] / of["all"] for verdict in ("right", "wrong"))
        known = lambda of: 100 * of["wrong"] / max(of["right"] + of["wrong"], 1)
        interval = ""
        if len(seeds) > 9:
            dice = random.Random(1)
            draws = (dice.choices(list(seeds.values()), k=len(seeds)) for _ in range(2000))
            sums = sorted(known(sum(draw, collections.Counter())) for draw in draws)
            interval = f" ({sums[50]:.1f}–{sums[1949]:.1f})"
        print(f"| {algorithm} | {right:.1f} / {wrong:.2f} | {of['false']} "
              f"| {100 * near[algorithm]['found_obstacles'] / max(near[algorithm]['near'], 1):.1f} "
              f"| {near[algorithm]['missed']} of {near[algorithm]['near']} | {known(of):.2f}{interval} |")
print("\ndrives\n\n| algorithm | courses | finished, % | collisions | near misses | driven, m |\n|---|---:|---:|---:|---:|---:|")
sums = collections.defaultdict(collections.Counter)
for row in csv.DictReader(open("reports/rivals-drives/drives.csv")):
    of = sums[row["algorithm"]]
    of["courses"] += 1
    of["finished"] += row["finished"] == "true"
    for key in ("collisions", "near_misses", "driven_m"):
        of[key] += float(row[key])
for algorithm, of in sums.items():
    print(f"| {algorithm} | {of['courses']} | {100 * of['finished'] / of['courses']:.0f} | {of['collisions']:.0f} | "
          f"{of['near_misses']:.0f} | {of['driven_m']:.0f} |")
PYTHON
