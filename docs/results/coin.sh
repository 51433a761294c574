#!/usr/bin/env bash
# Two programs that are exchangeable by construction, compared 60 times, for docs/results/comparisons.md:
#   bash docs/results/coin.sh
# A drive of 280 pairs, in 20 blocks, is scored by two algorithms. A coin per pair says whose result goes to the one
# program and whose to the other. Then the second program loses right cells, and the least loss that 57 of 60 comparisons
# find is printed. Prints also the first words of the verdicts. All seeds are fixed; minutes. SVL names another program.
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
"$SVL" record arena --frames 280 --seed 31 -o run.mcap -q
"$SVL" score run.mcap --algo v3 --algo bm --rerun none -q -o two > /dev/null
SVL="$SVL" python3 - << 'PYTHON'
import collections
import csv
import json
import os
import pathlib
import random
import subprocess

COMPARISONS = 60
tables = {name: list(csv.DictReader(open(f"two/{name}.csv"))) for name in ("rows", "cells")}
manifest = json.load(open("two/manifest.json"))
labels = [own["label"] for own in manifest["algorithms"]]
manifest["algorithms"] = manifest["algorithms"][:1]
manifest["algorithms"][0].update(label="coin", name="coin")


def write(folder, chosen, loss, dice):
    """A report of the results that `chosen` names for each pair, with a share of its right cells wrong."""
    pathlib.Path(folder).mkdir(exist_ok=True)
    json.dump(manifest, open(f"{folder}/manifest.json", "w"))
    json.dump({"incomplete": None}, open(f"{folder}/summary.json", "w"))
    for name, rows in tables.items():
        with open(f"{folder}/{name}.csv", "w", newline="") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            for row in rows:
                if row["algorithm"] != chosen[row["sequence"]]:
                    continue
                row = row | {"algorithm": "coin"}
                if name == "rows" and row["cells_right"]:
                    cells = sum(int(row[f"cells_{state}"]) for state in ("right", "wrong", "unknown"))
                    lost = sum(dice.random() < loss for _ in range(cells))
                    lost = min(lost, int(row["cells_right"]))
                    row["cells_right"] = int(row["cells_right"]) - lost
                    row["cells_wrong"] = int(row["cells_wrong"]) + lost
                table.writerow(row)


def failures(loss):
    """The number of comparisons that fail, and their verdicts."""
    failed, words, points = 0, collections.Counter(), 0
    for seed in range(COMPARISONS):
        dice = random.Random(seed)
        coins = {row["sequence"]: dice.random() < 0.5 for row in tables["rows"]}
        for folder, side in (("base", False), ("other", True)):
            chosen = {pair: labels[coin == side] for pair, coin in coins.items()}
            write(folder, chosen, loss if side else 0, dice)
        line = [os.environ["SVL"], "compare", "base", "other"]
        failed += subprocess.run([*line, "--fail-on", "worse"], capture_output=True).returncode == 3
        if loss == 0:
            text = subprocess.run(line, capture_output=True, text=True).stdout
            words[text.split(":")[0]] += 1
    return failed, words


failed, words = failures(0)
print(f"exchangeable: {failed} of {COMPARISONS} comparisons fail;", ", ".join(f"{n} {word}" for word, n in words.items()))
for points in (1, 2, 3, 4, 5, 6, 8, 10):
    found, _ = failures(points / 100)
    print(f"a loss of {points} points of right: {found} of {COMPARISONS} comparisons fail")
    if found >= 0.95 * COMPARISONS:
        break
PYTHON
