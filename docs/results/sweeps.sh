#!/usr/bin/env bash
# The score that a sweep reports beside that of a fresh seed: bash docs/results/sweeps.sh
# 60 settings each of v3 and bm on a drive of the arena, 280 pairs, for SEEDS seeds (10). Per seed and kind: the score on
# pairs that did not choose the setting, the score on those that did, and the score of the setting on the next seed, all
# right minus wrong, %; then the means of the differences from the fresh score. SVL names another program, EVERY takes
# every n-th pair alone.
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
for seed in $(seq 31 $((30 + ${SEEDS:-10}))); do
  "$SVL" record arena --frames 280 --seed "$seed" -o "$seed.mcap" -q
  "$SVL" score "$seed.mcap" --algo v3:texture_delta=2.5..4.4/0.1,smoothing_sigma=0/1/2 \
    --algo bm:uniqueness=0..45/5,block_size=5/7/9/11/13/15 --every "${EVERY:-1}" --rerun none -q -o "$seed" > /dev/null
  rm "$seed.mcap" && rm -rf "$seed/units" "$seed/"cells.*
done
python3 - << 'PYTHON'
import glob
import json

reports = [json.load(open(path)) for path in sorted(glob.glob("*/summary.json"))]
differences = []
for report, fresh in zip(reports, reports[1:] + reports[:1]):
    scores = {own["algorithm"]: 100 * (own["right"] - own["wrong"]) for own in fresh["algorithms"]}
    for choice in report["choices"]:
        own, score, next_seed = 100 * choice["own_score"], 100 * choice["score"], scores[choice["setting"]]
        differences.append((score - next_seed, own - next_seed))
        print(f"{choice['setting']}: {score:.1f} on others, {own:.1f} on its own, {next_seed:.1f} on the next seed")
for kind, values in zip(("reported", "of the choice's own pairs"), zip(*differences)):
    print(f"{kind} minus fresh: {sum(values) / len(values):+.2f} points over {len(values)} sweeps")
PYTHON
