#!/usr/bin/env bash
# Revision 3 of v5 on the seeds and scenes that docs/results/v5.md names: bash docs/revision3.sh DATASETS [MODEL.onnx]
# The network, if one is named, matches every tenth pair through adapters/svl_onnx.py (PYTHON has onnxruntime).
# Prints, for each set of scenes, right and wrong cells, missed and false obstacles of v5 (revisions 3 and 2), v3, bm
# and sgm; then calibration error, area of the ROC and the curve of both revisions. Writes
# docs/pictures/revision3.svg. The reports stay in reports/revision3-*.
set -euo pipefail
datasets="$(realpath "${1:?the folder of the data sets}")"
cd "$(dirname "$0")/.."
svl() { cargo run --profile "${PROFILE:-release}" --quiet --locked -- "$@"; }
algorithms=(--algo v5:revision=3,confidence=0.001/0.9 --algo v5:revision=2,confidence=0.001/0.85
  --algo v3 --algo bm:uniqueness=0/15/60 --algo sgm:uniqueness=0/5/60)
network="${2:+network=exec:command='${PYTHON:-python3} adapters/svl_onnx.py $2',max_disparity=127,timeout_s=300}"
score() {
  local name="$1"
  shift
  svl score "$@" "${algorithms[@]}" --rerun none --quiet -o "reports/revision3-$name" >/dev/null
  if [ -n "$network" ]; then
    local every=10
    case "$name" in playground | street | middlebury) every=1 ;; esac
    svl score "$@" --every "$every" --algo "$network" --rerun none --quiet -o "reports/revision3-$name-network" >/dev/null
  fi
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
import collections
import csv
import os

ALL = {"3": "v5:revision=3,confidence=0.001", "2": "v5:revision=2,confidence=0.001"}
ENDS = [0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.9, 0.95, 0.98, 1.000001]  # those of `svl train cells`
SHARES = [0.5, 0.6, 0.7, 0.8, 0.9]
SETS = {name: [name] for name in ("arena", "worlds", "shapes", "courses", "middlebury")}
SETS["two real pairs"] = ["playground", "street"]


def judged(part):
    """The cells of a report that have a truth."""
    for report in (f"reports/revision3-{part}/cells.csv", f"reports/revision3-{part}-network/cells.csv"):
        if os.path.exists(report):
            yield from (row for row in csv.DictReader(open(report)) if row["verdict"] != "no-truth")


def curve(ranked, total, shares):
    """Known and wrong cells, % of cells and of these, of the most probable ones."""
    for share in shares:
        n = round(share * total)
        if 0 < n <= len(ranked):
            yield 100 * share, 100 * sum(not right for _, right in ranked[:n]) / n


def figures(ranked):
    """Calibration error in points, and area of the ROC."""
    error = 0
    for low, high in zip(ENDS, ENDS[1:]):
        error += abs(sum(p - right for p, right in ranked if low <= p < high))
    by = collections.defaultdict(list)
    for p, right in ranked:
        by[p].append(right)
    below = wins = 0
    for p in sorted(by):
        good = sum(by[p])
        # Equal probabilities share their mean rank.
        wins += good * (below + (len(by[p]) - good) / 2)
        below += len(by[p]) - good
    good = sum(right for _, right in ranked)
    return 100 * error / len(ranked), wins / max(good * (len(ranked) - good), 1)


charts = {}
for name, parts in SETS.items():
    counts, cells = collections.defaultdict(collections.Counter), collections.defaultdict(list)
    for row in (row for part in parts for row in judged(part)):
        of = counts[row["algorithm"]]
        of[row["verdict"]] += 1
        of["all"] += 1
        of["missed"] += row["missed_median"] == "true"
        of["false"] += row["false_median"] == "true"
        # Without a report: nothing was seen, or the report is infinity.
        if row["algorithm"] in ALL.values() and row["verdict"] != "unknown":
            cells[row["algorithm"]].append((float(row["probability"]), row["verdict"] == "right"))
    total = counts[ALL["3"]]["all"]
    print(f"\n{name}: {total} cells with truth\n")
    print("| algorithm | right, % | wrong, % | known, % | wrong of known, % | missed / false |")
    print("|---|---:|---:|---:|---:|---:|")
    points = {}
    for algorithm, of in counts.items():
        known = of["right"] + of["wrong"]
        shares = [100 * of["right"] / of["all"], 100 * of["wrong"] / of["all"], 100 * known / of["all"],
                  100 * of["wrong"] / max(known, 1)]
        points[algorithm] = shares[2:]
        print(f"| {algorithm} | " + " | ".join(f"{x:.2f}" for x in shares) + f" | {of['missed']} / {of['false']} |")
    print("\n| revision | error | area | wrong of known, %, at 50 | 60 | 70 | 80 | 90 % known |\n|" + "---|" * 8)
    charts[name] = {"points": points}
    for revision, algorithm in ALL.items():
        ranked = sorted(cells[algorithm], reverse=True)
        error, area = figures(ranked)
        at = [f"{wrong:.2f}" for _, wrong in curve(ranked, total, SHARES)]
        print(f"| {revision} | {error:.1f} | {area:.3f} | " + " | ".join(at + [""] * (len(SHARES) - len(at))) + " |")
        charts[name][revision] = list(curve(ranked, total, [n / 50 for n in range(5, 51)]))

# A small chart per set: wrong against known cells.
SIDE, LEFT, TOP, MOST = 200, 46, 46, 20.0
COLOURS = {"v5:revision=3": "#0072B2", "v5:revision=2": "#56B4E9", "v3": "#999999", "bm": "#E69F00", "sgm": "#009E73",
           "network": "#D55E00"}
if not any("network" in chart["points"] for chart in charts.values()):
    del COLOURS["network"]
svg = []
for i, (name, chart) in enumerate(list(charts.items())[:5]):
    x0, y0 = LEFT + i % 3 * (SIDE + LEFT + 14), TOP + i // 3 * (SIDE + TOP + 30)
    at = lambda known, wrong: f"{x0 + SIDE * known / 100:.1f},{y0 + SIDE * (1 - min(wrong, MOST) / MOST):.1f}"
    svg.append(f'<rect x="{x0}" y="{y0}" width="{SIDE}" height="{SIDE}" fill="none" stroke="#808080"/>')
    svg.append(f'<text x="{x0}" y="{y0 - 8}" font-weight="bold">{name}</text>')
    for known in (0, 50, 100):
        svg.append(f'<text x="{x0 + SIDE * known / 100:.0f}" y="{y0 + SIDE + 15}" text-anchor="middle">{known}</text>')
    for wrong in (0, 5, 10, 15, 20):
        y = y0 + SIDE * (1 - wrong / MOST)
        svg.append(f'<text x="{x0 - 5}" y="{y + 4:.0f}" text-anchor="end">{wrong}</text>')
        svg.append(f'<path d="M{x0} {y:.0f}h{SIDE}" stroke="#808080" stroke-opacity="0.25"/>')
    for label, colour in COLOURS.items():
        dots = sorted(p for a, p in chart["points"].items() if a.split(",")[0].split(":u")[0] == label and p[0]
                      and "0.001" not in a)
        # Beyond the chart: a dot at its upper edge.
        for x, y in (at(*dot).split(",") for dot in dots):
            svg.append(f'<circle cx="{x}" cy="{y}" r="3.5" fill="{colour}"/>')
        line = chart.get(label[-1], dots) if label.startswith("v5") else dots
        line = " ".join(at(*point) for point in line)
        svg.append(f'<polyline fill="none" stroke="{colour}" stroke-width="2" points="{line}"/>')
x0, y0 = LEFT + 2 * (SIDE + LEFT + 14), TOP + SIDE + TOP + 30
for i, (label, colour) in enumerate(COLOURS.items()):
    svg.append(f'<circle cx="{x0 + 10}" cy="{y0 + 20 + 22 * i}" r="4" fill="{colour}"/>')
    svg.append(f'<text x="{x0 + 22}" y="{y0 + 24 + 22 * i}">{label}</text>')
svg.append(f'<text x="{x0}" y="{y0 + 172}">across: known, % of cells</text>')
svg.append(f'<text x="{x0}" y="{y0 + 190}">up: wrong, % of the known, to {MOST:.0f}</text>')
size = f"{LEFT + 3 * (SIDE + LEFT + 14)} {2 * (TOP + SIDE + 30) + 20}"
head = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" font-family="sans-serif" font-size="12" '
        'fill="#404040"><rect width="100%" height="100%" fill="#ffffff"/>')
with open("docs/pictures/revision3.svg", "w") as file:
    file.write("\n".join([head, *svg, "</svg>"]) + "\n")
PYTHON
