#!/usr/bin/env bash
# Two programs that are exchangeable by construction, compared 60 times, for docs/results/README.md:
#   bash docs/results/coin.sh
# A drive of 280 pairs, in 20 blocks, is scored by four algorithms. Per pair of algorithms, a coin per 1, 7, 14, 28 or 40
# neighbouring pairs says whose results go to the one program and whose to the other. Then the second program loses
# right cells. Prints how many of the comparisons fail `--fail-on worse`. All seeds are fixed; a quarter of an hour. SVL
# names another program.
set -euo pipefail
cd "$(dirname "$0")/../.."
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
if [ -z "${SVL:-}" ]; then
  cargo build --profile "${PROFILE:-release}" --quiet --locked --bin svl
  SVL="${CARGO_TARGET_DIR:-target}/${PROFILE:-release}/svl"
fi
SVL="$(realpath "$SVL")"
cd "$work"
"$SVL" record arena --frames 280 --seed 305 -o run.mcap -q
"$SVL" score run.mcap --algo v3 --algo v4 --algo bm --algo sgm --rerun none -q -o all > /dev/null
SVL="$SVL" python3 - << 'PYTHON'
import csv
import json
import os
import pathlib
import random
import subprocess

COMPARISONS = 60
PAIRS = [("v3", "sgm"), ("v3", "v4"), ("v3", "bm"), ("bm", "sgm")]
RUNS = [1, 7, 14, 28, 40]
LOSSES = {("v3", "v4"): [1, 2, 3], ("v3", "bm"): [2, 3, 4]}
rows = list(csv.DictReader(open("all/rows.csv")))
manifest = json.load(open("all/manifest.json"))
manifest["algorithms"] = manifest["algorithms"][:1]
manifest["algorithms"][0].update(label="coin", name="coin")


def write(folder, chosen, loss, dice):
    """A report of the results that `chosen` names for each pair, with a share of its right cells wrong."""
    pathlib.Path(folder).mkdir(exist_ok=True)
    json.dump(manifest, open(f"{folder}/manifest.json", "w"))
    json.dump({"incomplete": None}, open(f"{folder}/summary.json", "w"))
    with open(f"{folder}/rows.csv", "w", newline="") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        for row in rows:
            if row["algorithm"] != chosen[int(row["sequence"])]:
                continue
            row = row | {"algorithm": "coin"}
            cells = sum(int(row[f"cells_{state}"] or 0) for state in ("right", "wrong", "unknown"))
            lost = min(sum(dice.random() < loss for _ in range(cells)), int(row["cells_right"] or 0))
            if lost:
                row["cells_right"] = int(row["cells_right"]) - lost
                row["cells_wrong"] = int(row["cells_wrong"]) + lost
            table.writerow(row)


def failures(labels, run, loss):
    """The number of comparisons that fail."""
    failed = 0
    last = max(int(row["sequence"]) for row in rows)
    for seed in range(COMPARISONS):
        dice = random.Random(seed)
        offset = dice.randrange(run)
        coins = [dice.random() < 0.5 for _ in range(last // run + 2)]
        for folder, side in (("base", False), ("other", True)):
            chosen = [labels[coins[(pair + offset) // run] == side] for pair in range(last + 1)]
            write(folder, chosen, loss if side else 0, dice)
        line = [os.environ["SVL"], "compare", "base", "other", "--fail-on", "worse"]
        failed += subprocess.run(line, capture_output=True).returncode == 3
    return failed


for labels in PAIRS:
    found = [f"{failures(labels, run, 0)} at a coin per {run}" for run in RUNS]
    print(f"{'/'.join(labels)}, exchangeable: of {COMPARISONS} comparisons fail", ", ".join(found), flush=True)
for labels, losses in LOSSES.items():
    for points in losses:
        found = failures(labels, 1, points / 100)
        print(f"{'/'.join(labels)}, a loss of {points} points of right: {found} of {COMPARISONS} fail", flush=True)
PYTHON
