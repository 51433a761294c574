"""Computes a report's accuracy.csv again from its cells.csv and rows.csv, with numpy.

python3 accuracy.py REPORT
"""

import csv
import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

report = Path(sys.argv[1])
table = lambda name: list(csv.DictReader(open(report / name)))
rule = json.load(open(report / "manifest.json"))["description"]["cells"]
tolerance = lambda z: max(rule["tolerance_m"], rule["tolerance_percent"] / 100 * z)

number = lambda text: float(text) if text else None
tracks = defaultdict(list)
for cell in table("cells.csv"):
    truth = number(cell["true_distance_m"])
    if truth is not None and cell["verdict"] != "no-truth":
        known = cell["state"] in ("", "known", "far")
        reported = number(cell["distance_m"]) if known else None
        key = cell["algorithm"], cell["column"], cell["row"]
        tracks[key].append((cell["area"], truth, reported, known, cell["verdict"]))

equal = 0
for row in table("accuracy.csv"):
    start, end = float(row["from_m"]), number(row["to_m"])
    if row["is_of_pixels"] == "true":
        continue
    inside = lambda z: start <= z and (end is None or z < end)
    own = lambda area: row["area"] in ("all", area.replace("pixels", "obstacle"))
    errors, relative, resting, flickers, steps = [], [], 0, 0, []
    scored, knowns, unknowns, wrongs = 0, 0, 0, 0
    for (algorithm, _, _), track in tracks.items():
        if algorithm != row["algorithm"]:
            continue
        for area, truth, reported, known, verdict in track:
            if own(area) and inside(truth):
                scored, knowns = scored + 1, knowns + known
                unknowns, wrongs = unknowns + (verdict == "unknown"), wrongs + (verdict == "wrong")
            if own(area) and reported is not None and inside(truth):
                errors.append(reported - truth)
                relative.append(abs(reported - truth) / truth)
        for (_, truth_a, was, *_), (area, truth_b, now, *_) in zip(track, track[1:]):
            if not own(area) or not inside(truth_b) or abs(truth_b - truth_a) > 0.01 * truth_a:
                continue
            resting += 1
            if was is None and now is None:
                continue
            if was is None or now is None or abs(now - was) > tolerance(truth_b):
                flickers += 1
            if was is not None and now is not None:
                steps.append((now - truth_b) - (was - truth_a))
    errors = np.array(errors)
    assert int(row["cells"]) == len(errors) and int(row["resting"]) == resting, row
    assert int(row["scored"]) == scored and int(row["known"]) == knowns, row
    expected = {"flicker": flickers / resting if resting and len(errors) else None}
    expected["fill"] = 1 - unknowns / scored if scored else None
    expected["wrong"] = wrongs / scored if scored else None
    expected["noise_m"] = np.sqrt(np.mean(np.square(steps)) / 2) if steps else None
    if len(errors):
        expected["bias_m"] = errors.mean()
        expected["rmse_m"] = np.sqrt(np.mean(errors**2))
        expected["median_error_m"] = np.sort(np.abs(errors))[int(np.ceil(len(errors) / 2)) - 1]
        expected["abs_rel"] = np.mean(relative)
    for name, value in expected.items():
        found = number(row[name])
        same = found is None if value is None else np.isclose(found, value, rtol=1e-5, atol=1e-9)
        assert same, (row, name, value)
    equal += 1
print(equal, "rows equal")
