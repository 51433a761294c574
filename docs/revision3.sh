#!/usr/bin/env bash
# Revision 3 of v5 on the seeds and scenes that docs/results/v5.md names: bash docs/revision3.sh DATASETS
# Prints, for each set of scenes, right and wrong cells, missed and false obstacles of v5's revisions 3 and 2, v3, bm and
# sgm; then calibration error, area of the ROC and the curve of both revisions. The reports stay in reports/revision3-*.
set -euo pipefail
datasets="$(realpath "${1:?the folder of the data sets}")"
cd "$(dirname "$0")/.."
svl() { cargo run --profile "${PROFILE:-release}" --quiet --locked -- "$@"; }
algorithms=(--algo v5:revision=3,confidence=0.001/0.9 --algo v5:revision=2,confidence=0.001/0.85
  --algo v3 --algo bm:uniqueness=0/15/60 --algo sgm:uniqueness=0/5/60)
score() {
  local name="$1"
  shift
  svl score "$@" "${algorithms[@]}" --rerun none --quiet -o "reports/revision3-$name" >/dev/null
}

score playground scenarios/eth3d.toml --data "$datasets" --scenes eth3d-playground_1l
score street scenarios/kitti2012.toml --data "$datasets" --scenes kitti2012-000000_10
score middlebury scenarios/middlebury.toml --data "$datasets"
score arena scenarios/arena.toml --seeds 31..33
score worlds scenarios/worlds.toml --seeds 2001..2020
score shapes scenarios/shapes.toml --seeds 2001..2020
svl score scenarios/drive.toml --algo truth --seeds 201..204 --quiet -o reports/revision3-drive >/dev/null
score courses reports/revision3-drive/course-*-truth.mcap

python3 - << 'PYTHON'
import collections, csv
ALL = {"3": "v5:revision=3,confidence=0.001", "2": "v5:revision=2,confidence=0.001"}
ENDS = [0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.9, 0.95, 0.98, 1.000001]  # those of `svl train cells`
for name, parts in [("arena", ["arena"]), ("worlds", ["worlds"]), ("shapes", ["shapes"]), ("courses", ["courses"]),
                    ("middlebury", ["middlebury"]), ("two real pairs", ["playground", "street"])]:
    counts = collections.defaultdict(collections.Counter)
    cells = collections.defaultdict(list)
    for part in parts:
        for row in csv.DictReader(open(f"reports/revision3-{part}/cells.csv")):
            if row["verdict"] == "no-truth":
                continue
            of = counts[row["algorithm"]]
            of[row["verdict"]] += 1
            of["all"] += 1
            of["missed"] += row["missed_obstacle"] == "true"
            of["false"] += row["false_obstacle"] == "true"
            # Without a report, with a probability: nothing was seen, or the report is infinity.
            if row["algorithm"] in ALL.values() and row["probability"] and row["verdict"] != "unknown":
                cells[row["algorithm"]].append((float(row["probability"]), row["verdict"] == "right"))
    total = counts[ALL["3"]]["all"]
    print(f"\n{name}: {total} cells with truth\n")
    print("| algorithm | right, % | wrong, % | known, % | wrong of known, % | missed / false |\n|---|---:|---:|---:|---:|---:|")
    for algorithm, of in counts.items():
        known = of["right"] + of["wrong"]
        shares = [100 * n / total for n in (of["right"], of["wrong"], known)] + [100 * of["wrong"] / max(known, 1)]
        print(f"| {algorithm} | " + " | ".join(f"{x:.2f}" for x in shares) + f" | {of['missed']} / {of['false']} |")
    print("\n| revision | error | area | wrong of known, %, at 50 | 60 | 70 | 80 | 90 % known |\n|---|---:|---:|---:|---:|---:|---:|---:|")
    for revision, algorithm in ALL.items():
        ranked = sorted(cells[algorithm], reverse=True)
        error = 0
        for low, high in zip(ENDS, ENDS[1:]):
            inside = [cell for cell in ranked if low <= cell[0] < high]
            error += abs(sum(p - right for p, right in inside))
        # Rank sum of the right cells; equal probabilities share their mean rank.
        by = collections.defaultdict(list)
        for p, right in ranked:
            by[p].append(right)
        below = wins = 0
        for p in sorted(by):
            good = sum(by[p])
            wins += good * (below + (len(by[p]) - good) / 2)
            below += len(by[p]) - good
        good = sum(right for _, right in ranked)
        area = wins / max(good * (len(ranked) - good), 1)
        curve = []
        for share in (0.5, 0.6, 0.7, 0.8, 0.9):
            n = round(share * total)
            wrong = sum(not right for _, right in ranked[:n])
            curve.append(f"{100 * wrong / n:.2f}" if n <= len(ranked) else "")
        print(f"| {revision} | {100 * error / len(ranked):.1f} | {area:.3f} | " + " | ".join(curve) + " |")
PYTHON
