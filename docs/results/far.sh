#!/usr/bin/env bash
# What is at infinity (docs/results/v5.md, section Far): bash docs/results/far.sh [ALGORITHM ...]
# A textured scene at known shifts, then the beams of the scan in a hall. Needs NumPy, and `mcap` for the beams.
set -euo pipefail
cd "$(dirname "$0")/../.."
export SVL="${SVL:-target/release/svl}"
[ "$SVL" != target/release/svl ] || cargo build --release --quiet --locked
mkdir -p reports/far
cat > reports/far/hall.toml << 'TOML'
name = "hall"
algorithms = ["v5"]
[source]
kind = "arena"
seeds = [1]
[arena]
frames = 40
rate_hz = 2.0
[arena.rig]
above_floor_m = 0.5
[arena.sensor]
focus_m = 5.0
[arena.robot]
path = [{ at_m = [4.0, 2.0], heading_deg = 90.0 }, { at_m = [4.0, 9.0], heading_deg = 90.0 }]
[arena.world]
width_m = 8.0
length_m = 20.0
wall_height_m = 0.05
room_margin_m = 20.0
floor_patterns = ["noise"]
blocks = []
balls = []
TOML
"$SVL" record reports/far/hall.toml -o reports/far/hall.mcap --force --quiet
"${SVL_PYTHON:-python3}" - "$@" << 'PYTHON'
import collections, json, math, os, struct, subprocess, sys
import numpy as np

svl, folder, names = os.environ["SVL"], "reports/far", sys.argv[1:] or "v5 v1 v2 v3 v4 bm sgm dp".split()
width, height, focal_baseline = 320, 240, 14.4

def run(*words):
    return subprocess.run([svl, *words], check=True, capture_output=True, text=True).stdout

def pair(seed, shift):
    """Noise of a natural spectrum, shifted in the frequency domain; each image has noise of its own."""
    random = np.random.default_rng(seed)
    rows, columns = np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)[None, :]
    frequency = np.hypot(rows, columns)
    texture = np.fft.fft2(random.normal(size=(height, width)))
    texture *= np.exp(-(frequency * 2 * np.pi) ** 2 / 2) / (frequency + 0.02)
    texture[0, 0] = 0
    shifts = [1, np.exp(2j * np.pi * columns * shift)]
    images = [np.fft.ifft2(texture * shift).real for shift in shifts]
    scale = 40 / images[0].std()
    for name, image in zip("lr", images):
        noisy = scale * image + 110 + 3 * random.normal(size=image.shape)
        with open(f"{folder}/{name}.pgm", "wb") as file:
            file.write(b"P5 %d %d 255\n" % (width, height) + np.clip(np.rint(noisy), 0, 255).astype(np.uint8).tobytes())

def verdict(true, cell):
    if cell["state"] in ("unknown", "near"):
        return "unknown"
    px = cell["disparity_px"]
    if true <= 0 or px <= 0:
        return "right" if max(true, px) <= 1 else "wrong"
    error = abs(focal_baseline / px - focal_baseline / true)
    return "right" if error <= max(0.1, 0.2 * focal_baseline / true) else "wrong"

with open(f"{folder}/calib.txt", "w") as file:
    k = "[320 0 160; 0 320 120; 0 0 1]"
    file.write(f"cam0={k}\ncam1={k}\ndoffs=0\nbaseline={1000 * focal_baseline / 320}\nwidth=320\nheight=240\n")
print("right / wrong / unknown cells, far ones at these shifts, px")
for name in names:
    for shift in (0, 0.25, 0.5, 1, 2):
        counts = collections.Counter()
        for seed in range(6):
            pair(seed, shift)
            files = [f"{folder}/{file}" for file in ("l.pgm", "r.pgm", "d.pfm", "calib.txt")]
            found = run("match", *files[:2], "-o", files[2], "--force", "--calib", files[3], "--algo", name, "--json")
            for cell in json.loads(found)["cells"]:
                counts[verdict(shift, cell)] += 1
                counts["far"] += cell["state"] == "far"
        print(name, shift, *(counts[key] for key in ("right", "wrong", "unknown", "far")))

from mcap.reader import make_reader

print("beams of the scan in the hall: free, obstacles, all")
for name in names:
    run("replay", f"{folder}/hall.mcap", "--algo", name, "-o", f"{folder}/result.mcap", "--force", "--quiet")
    run("record", f"{folder}/result.mcap", "--ros2", "-o", f"{folder}/bag.mcap", "--force", "--quiet")
    ranges = []
    with open(f"{folder}/bag.mcap", "rb") as file:
        for schema, _, message in make_reader(file).iter_messages():
            if schema.name == "sensor_msgs/msg/LaserScan":
                data, at = message.data[4:], 8
                at += 4 + struct.unpack_from("<I", data, at)[0]
                at = (at + 3) // 4 * 4 + 7 * 4
                count = struct.unpack_from("<I", data, at)[0]
                ranges += struct.unpack_from(f"<{count}f", data, at + 4)
    print(name, sum(map(math.isinf, ranges)), sum(map(math.isfinite, ranges)), len(ranges))
PYTHON
