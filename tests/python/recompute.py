"""Shares, errors, what they rest on, and gates of ten random bags, computed again from cells.csv and rows.csv.

python3 recompute.py SVL FOLDER
"""

import csv
import json
import math
import random
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

svl, folder = sys.argv[1], Path(sys.argv[2])
SHARE, TWO_FRAMES = 0.95, 2
# Per metric: the least number of its cases, and the least share of the cells that could have a value.
MINIMA = {name: (1, None) for name in ("right", "wrong", "unknown", "missed", "false", "found")}
MINIMA |= {name: (1, SHARE) for name in ("bias", "rmse", "median_error", "abs_rel")}
MINIMA |= {"noise": (TWO_FRAMES, SHARE), "flicker": (TWO_FRAMES, None)}


def run(*words):
    return subprocess.run([svl, *words], cwd=folder, capture_output=True, text=True)


def limits(dice):
    """Limits of random metrics: most are near what matchers reach, some need more cases than there are."""
    for name in dice.sample(sorted(MINIMA), 6):
        limit = {"algorithm": dice.choice(["v3", "bm"]), "metric": name}
        if name == "bias":
            limit["max_magnitude"] = round(dice.uniform(0.01, 0.5), 3)
        elif name in ("missed", "false"):
            limit["max"] = dice.randint(0, 9)
        else:
            limit[dice.choice(["min", "max"])] = round(dice.uniform(0.01, 0.9), 3)
        if dice.random() < 0.4:
            limit["min_cases"] = dice.choice([1, 3, 100, 10_000])
        if MINIMA[name][1] and dice.random() < 0.4:
            limit["min_share"] = dice.choice([0.2, 0.6, 1.0])
        yield limit


def values(rows, cells, rule):
    """Per metric its value, and the numbers of frames, cells and possible cells that it rests on."""
    scored = [c for c in cells if c["verdict"] != "no-truth" and c["area"] == "obstacle"]
    everywhere = sum(c["verdict"] != "no-truth" for c in cells)
    found = {}
    for name in ("right", "wrong", "unknown"):
        count = sum(c["verdict"] == name for c in scored)
        found[name] = (count / len(scored) if scored else None, None, len(scored), None)
    near = sum(int(row["near"] or 0) for row in rows)
    found["missed"] = (sum(c["missed"] == "true" for c in cells), None, near, None)
    found["false"] = (sum(c["false"] == "true" for c in cells), None, everywhere, None)
    met = sum(int(row["found_obstacles"] or 0) for row in rows)
    found["found"] = (met / near if near else None, None, near, None)
    finite = [c for c in scored if c["true_distance_m"] and c["state"] == "known"]
    pairs = [(float(c["distance_m"]), float(c["true_distance_m"])) for c in finite if c["distance_m"]]
    errors = [z - true for z, true in pairs]
    if errors:
        sizes = sorted(map(abs, errors))
        means = {
            "bias": sum(errors) / len(errors),
            "rmse": math.sqrt(sum(e * e for e in errors) / len(errors)),
            "median_error": sizes[(len(sizes) + 1) // 2 - 1],
            "abs_rel": sum(abs(z - true) / true for z, true in pairs) / len(pairs),
        }
        found |= {name: (value, None, len(errors), len(finite)) for name, value in means.items()}
    stamps = {row["sequence"]: int(row["stamp_ns"]) for row in rows}
    tracks = defaultdict(list)
    for c in cells:
        if c["verdict"] != "no-truth" and c["true_distance_m"]:
            tracks[c["column"], c["row"]].append(c)
    frames, rests, both_known, steps, flickers = set(), 0, 0, [], 0
    for track in tracks.values():
        for a, b in zip(track, track[1:]):
            gap = stamps[b["sequence"]] - stamps[a["sequence"]]
            was_true, is_true = float(a["true_distance_m"]), float(b["true_distance_m"])
            if b["area"] != "obstacle" or gap > 1e9 or abs(is_true - was_true) > 0.01 * was_true:
                continue
            frames.add(b["sequence"])
            rests += 1
            both_known += a["state"] == b["state"] == "known"
            was, now = (float(c["distance_m"]) if c["state"] == "known" and c["distance_m"] else None for c in (a, b))
            if was is not None and now is not None:
                steps.append((now - is_true) - (was - was_true))
                tolerance = max(rule["tolerance_m"], rule["tolerance_percent"] / 100 * is_true)
                flickers += abs(now - was) > tolerance
            else:
                flickers += (was is None) != (now is None)
    frames = len(frames) + bool(frames)
    if steps:
        noise = math.sqrt(sum(s * s for s in steps) / len(steps) / 2)
        found["noise"] = (noise, frames, len(steps), both_known)
    if rests and errors:
        found["flicker"] = (flickers / rests, frames, rests, None)
    return found


def is_measured(name, own, cases=None, share=None):
    _, frames, cells, possible = own
    least, least_share = MINIMA[name]
    count = cells if frames is None else frames
    share = least_share if share is None else share
    enough = possible is None or share is None or cells >= share * possible
    return count >= (least if cases is None else cases) and enough


def close(a, b):
    return a is b is None or None not in (a, b) and math.isclose(a, b, rel_tol=1e-5, abs_tol=1e-7)


shares = gates = 0
states = defaultdict(int)
for bag in range(10):
    dice = random.Random(bag)
    near = dice.choice([0.01, 0.3, 0.5, 1.0])
    frames = dice.choice([1, 2, 12, 25])
    run("record", "arena", "--frames", str(frames), "--seed", str(dice.randint(1, 10**6)), "-o", "bag.mcap", "-q", "--force")
    text = f'name = "bag"\nalgorithms = ["v3:max_disparity={dice.choice([8, 24, 80])}", "bm"]\n'
    text += '[source]\nkind = "recording"\nfiles = ["bag.mcap"]\n[cells]\njudge = "distance"\n'
    text += f"obstacle_m = {near}\nclear_m = {1.5 * near}\n"
    for limit in limits(dice):
        text += "[[gate]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in limit.items())
    (folder / "bag.toml").write_text(text)
    ran = run("score", "bag.toml", "--gate", "--json", "--rerun", "none", "-q", "--force", "-o", f"bag-{bag}")
    assert ran.returncode in (0, 3), ran.stderr
    report, results = folder / f"bag-{bag}", json.loads(ran.stdout)
    table = lambda name: list(csv.DictReader(open(report / f"{name}.csv")))
    rows, cells = table("rows"), table("cells")
    rule = json.load(open(report / "manifest.json"))["description"]["cells"]
    expected = {}
    for own in results["algorithms"]:
        label = own["algorithm"]
        of = lambda table: [row for row in table if row["algorithm"] == label]
        expected[label] = values(of(rows), of(cells), rule)
        for name, found in expected[label].items():
            value = found[0] if is_measured(name, found) else None
            assert close(own.get(name), value), (bag, label, name, own.get(name), found)
            if found[0] is not None:
                cases = own["cases"][name]
                assert found[1] in (None, cases["items"]) and found[2] == cases["cells"], (bag, name, cases, found)
                assert found[3] == cases.get("possible"), (bag, name, cases, found)
            shares += 1
    assert any(result["state"] == "fail" for result in results["gate"]) <= (ran.returncode == 3)
    for result in results["gate"]:
        limit = result["limit"]
        name, found = limit["metric"], expected[result["algorithm"]].get(limit["metric"])
        high = limit.get("max_magnitude")
        low, high = (limit.get("min"), limit.get("max")) if high is None else (-high, high)
        state = "not-measured"
        if found and found[0] is not None and is_measured(name, found, limit.get("min_cases"), limit.get("min_share")):
            keeps = (low is None or found[0] >= low) and (high is None or found[0] <= high)
            state = "pass" if keeps else "fail"
        assert result["state"] == state, (bag, result, found)
        states[state] += 1
        gates += 1
print(f"{shares} numbers and {gates} gates equal:", dict(sorted(states.items())))
