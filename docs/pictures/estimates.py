"""Estimated wrong cells beside the true ones: estimates.py REPORT… >estimates.svg

Each report is of a run with truth, scored with --columns wrong,estimated_wrong; a bar is an algorithm of it, from about
to at most, of the known obstacle cells.
"""

import csv
import sys

SIZE, LEFT, TOP = 460, 60, 12


def rows(report, name):
    with open(f"{report}/{name}.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def at(percent):
    return SIZE * percent / 100


bars = []
for report in sys.argv[1:]:
    known = {row["algorithm"]: [int(row[f"cells_{kind}"] or 0) for kind in ("right", "wrong")] for row in rows(report, "summary")}
    for row in rows(report, "estimates"):
        if row["area"] == "obstacle" and row["estimated_wrong"]:
            right, wrong = known[row["algorithm"]]
            ends = [100 * float(row[f"estimated_wrong{end}"]) for end in ("", "_high")]
            bars.append((100 * wrong / (right + wrong), *ends))
lines = "".join(
    f'<path d="M{at(true):.1f} {SIZE - at(about):.1f}V{SIZE - at(high):.1f}m-4 0h8" stroke="#0072b2" stroke-width="2"/>'
    f'<circle cx="{at(true):.1f}" cy="{SIZE - at(about):.1f}" r="4" fill="#0072b2"/>'
    for true, about, high in bars
)
ticks = "".join(
    f'<path d="M{at(t)} {SIZE}v5M0 {SIZE - at(t)}h-5" stroke="#808080"/>'
    f'<text x="{at(t)}" y="{SIZE + 20}" text-anchor="middle">{t}</text>'
    f'<text x="-10" y="{SIZE - at(t) + 5}" text-anchor="end">{t}</text>'
    for t in range(0, 101, 20)
)
print(
    f"""<svg viewBox="0 0 {SIZE + LEFT + 20} {SIZE + TOP + 50}" xmlns="http://www.w3.org/2000/svg">
<title>estimated wrong cells by true ones</title>
<rect width="100%" height="100%" fill="#fff"/>
<g transform="translate({LEFT}, {TOP})" font-family="sans-serif" font-size="15" fill="#000">
<path d="M0 {SIZE}L{SIZE} 0" stroke="#808080" stroke-dasharray="4 4"/><path d="M0 0V{SIZE}H{SIZE}" stroke="#808080" fill="none"/>
{ticks}{lines}
<text x="{SIZE / 2}" y="{SIZE + 42}" text-anchor="middle">wrong, % of the known obstacle cells</text>
<text transform="translate(-44, {SIZE / 2}) rotate(-90)" text-anchor="middle">estimated: about (dot), at most</text>
</g>
</svg>"""
)
