#!/usr/bin/env bash
# v5 on seeds that nothing was fitted to (docs/results/v5.md): bash docs/results/v5.sh [DATASETS]
# The rule was written before the first run: these seeds, these settings, once. Prints a table per question; the reports
# stay in reports/v5-*. Settings: v5; single, v5 without earlier pairs; three, revision 3, from which it comes; all and
# all3, every cell of v5 and of three.
set -euo pipefail
datasets="${1:+$(realpath "$1")}"
cd "$(dirname "$0")/../.."
svl() { "${SVL:-target/release/svl}" "$@"; }
[ -n "${SVL:-}" ] || cargo build --release --quiet --locked
mkdir -p reports/v5
# The models of single pairs: the built-in one without `time`, and that with the slack of revision 3.
cargo test --release --quiet --locked --test bench -- --ignored models_of_single_pairs > /dev/null
models=reports/v5
algorithms=(--algo v5 --algo "single=v5:model=$models/single.safetensors" --algo "three=v5:model=$models/three.safetensors"
  --algo all=v5:confidence=0.001 --algo "all3=v5:model=$models/three.safetensors,confidence=0.001"
  --algo "all1=v5:model=$models/single.safetensors,confidence=0.001")
score() {
  local name="$1"
  shift
  svl score "$@" "${algorithms[@]}" --rerun none --quiet --force -o "reports/v5-$name" > /dev/null
}
sed 's/^frames = .*/frames = 120/; s/^rate_hz = .*/rate_hz = 10.0/' scenarios/worlds.toml > $models/worlds10.toml
sed 's/^frames = .*/frames = 840/; s/^rate_hz = .*/rate_hz = 30.0/' scenarios/arena.toml > $models/arena30.toml
score arena scenarios/arena.toml --seeds 7101..7110
score worlds10 $models/worlds10.toml --seeds 7201..7220
score worlds2 $models/worlds10.toml --seeds 7201..7220 --every 5
score shapes scenarios/shapes.toml --seeds 7301..7320
svl score scenarios/drive.toml --algo truth --seeds 7401..7404 --quiet --force -o reports/v5-drive > /dev/null
score courses reports/v5-drive/course-*-truth.mcap
score arena30 $models/arena30.toml --seeds 7501..7502
score noise scenarios/arena-noise.toml --seeds 7601..7602
# Obstacles that appear in a run of pieces from different places, and what the flags say.
[ -n "${SVL:-}" ] || cargo test --release --quiet --locked --test bench -- --ignored sudden_obstacles --nocapture
sets="worlds10 worlds2 courses shapes arena arena30 noise"
if [ -n "$datasets" ]; then
  score middlebury scenarios/middlebury.toml --data "$datasets"
  score playground scenarios/eth3d.toml --data "$datasets" --scenes eth3d-playground_1l
  score street scenarios/kitti2012.toml --data "$datasets" --scenes kitti2012-000000_10
  sets="$sets middlebury playground street"
fi
# shellcheck disable=SC2086
python3 - $sets << 'PYTHON'
import collections, csv, math, random, sys

NAMES = ["v5", "single", "three"]


def cells(name):
    """Per algorithm the rows of cells with truth."""
    rows = collections.defaultdict(list)
    for row in csv.DictReader(open(f"reports/v5-{name}/cells.csv")):
        if row["verdict"] != "no-truth":
            rows[row["algorithm"]].append(row)
    return rows


def found(name):
    """Per algorithm and seed: found, near, missed and false by the nearest quarter."""
    sums = collections.defaultdict(lambda: collections.Counter())
    for row in csv.DictReader(open(f"reports/v5-{name}/rows.csv")):
        for key in ("found_obstacles", "near", "missed", "false"):
            sums[row["algorithm"]][key] += int(float(row[key] or 0))
    return sums


def unit(row):
    return row["seed"] or row["run"] or str(row["sequence"])


def interval(by_unit):
    """95 % interval of a sum of differences, by resampling seeds."""
    values = list(by_unit.values())
    rng = random.Random(1)
    sums = sorted(sum(rng.choices(values, k=len(values))) for _ in range(2000))
    return sums[50], sums[1949]


def ranked(rows, count):
    """The most probable cells that report something."""
    known = [r for r in rows if r["verdict"] != "unknown"]
    return sorted(known, key=lambda r: -float(r["probability"]))[:count]


def near_flags(rows):
    return [r for r in rows if r["state"] == "near"]


for name in sys.argv[1:]:
    by = cells(name)
    near = found(name)
    print(f"\n## {name}: {len(by['v5'])} cells with truth\n")
    print("| algorithm | right, % | wrong, % | wrong of known, % | near found, % | missed | false | flags |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|")
    for algorithm in NAMES:
        rows = by[algorithm]
        n = collections.Counter(r["verdict"] for r in rows)
        known = n["right"] + n["wrong"]
        of = near[algorithm]
        share = 100 * of["found_obstacles"] / of["near"] if of["near"] else math.nan
        print(f"| {algorithm} | {100 * n['right'] / len(rows):.2f} | {100 * n['wrong'] / len(rows):.2f} | "
              f"{100 * n['wrong'] / max(known, 1):.2f} | {share:.1f} | {of['missed']} | {of['false']} | "
              f"{len(near_flags(rows))} |")
    if name == "arena":
        for seed in sorted({r["seed"] for r in by["v5"]}):
            part = []
            for algorithm in ("v5", "three"):
                rows = [r for r in by[algorithm] if r["seed"] == seed]
                n = collections.Counter(r["verdict"] for r in rows)
                part.append(f"{100 * n['right'] / len(rows):.1f} / {100 * n['wrong'] / len(rows):.2f}")
            print(f"seed {seed}: v5 {part[0]}, three {part[1]}")
    # At revision 3's number of known cells.
    count = sum(r["verdict"] in ("right", "wrong") for r in by["three"])
    difference = collections.defaultdict(int)
    wrong = {}
    for algorithm, sign in (("all", 1), ("all3", -1)):
        taken = ranked(by[algorithm], count)
        wrong[algorithm] = sum(r["verdict"] == "wrong" for r in taken)
        for r in by[algorithm]:
            difference[unit(r)] += 0
        for r in taken:
            difference[unit(r)] += sign * (r["verdict"] == "wrong")
    low, high = interval(difference)
    print(f"\nof {count} known, as many as three: wrong v5 {wrong['all']}, three {wrong['all3']}; "
          f"difference {low} to {high}")
    # Bias of known cells truly below 0.5 m.
    for algorithm in ("v5", "three"):
        errors = sorted(float(r["distance_m"]) / float(r["true_distance_m"]) - 1 for r in by[algorithm]
                        if r["verdict"] in ("right", "wrong") and r["distance_m"] and r["true_distance_m"]
                        and float(r["true_distance_m"]) < 0.5)
        if errors:
            print(f"{algorithm}: median error of {len(errors)} known cells truly < 0.5 m: {100 * errors[len(errors) // 2]:+.1f} %")
    # Predicted minus right from 0.85 on.
    for algorithm in ("all", "all3"):
        rows = [r for r in by[algorithm] if r["verdict"] != "unknown" and float(r["probability"]) >= 0.85]
        if rows:
            said = sum(float(r["probability"]) for r in rows) / len(rows)
            right = sum(r["verdict"] == "right" for r in rows) / len(rows)
            print(f"{algorithm}: from 0.85 on {len(rows)} cells, predicted {100 * said:.1f} %, right {100 * right:.1f} %, "
                  f"predicted - right {100 * (said - right):+.1f}")
PYTHON
