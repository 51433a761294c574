#!/usr/bin/env python3
"""OpenCV's StereoBM and StereoSGBM for svl's matcher `exec`.

    pip install numpy opencv-python-headless
    svl match left.png right.png -o d.pfm \\
        --algo "exec:command=python3 adapters/opencv.py sgbm --block 5"

svl_bench.matcher comes with svl's wheel; without it, in this file's folder:
`mkdir svl_bench` and `svl algos exec --example python > svl_bench/matcher.py`.
"""

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

# svl_bench: installed, beside this file, or in svl's repository.
sys.path.append(str(Path(__file__).resolve().parents[1] / "src/python"))
from svl_bench.matcher import serve


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("method", choices=["bm", "sgbm"])
    parser.add_argument("--block", type=int, help="side of the window, odd (default: bm 9, sgbm 3)")
    parser.add_argument("--uniqueness", type=int, help="margin over the second best, percent")
    parser.add_argument(
        "--speckle-window", type=int, help="smallest region that is kept, pixels; 0 = all"
    )
    parser.add_argument("--speckle-range", type=int, default=1, help="largest step within a region")
    parser.add_argument("--texture", type=int, help="bm: least texture of a window")
    parser.add_argument("--p1", type=int, help="sgbm: cost of a step by one (default 8 * block^2)")
    parser.add_argument("--p2", type=int, help="sgbm: cost of a larger step (default 32 * block^2)")
    return parser.parse_args()


def matcher(options, low, count):
    """OpenCV's matcher for disparities low ..= low + count - 1; count is a multiple of 16."""
    if options.method == "bm":
        stereo = cv2.StereoBM_create(count, options.block or 9)
        stereo.setMinDisparity(low)
        if options.texture is not None:
            stereo.setTextureThreshold(options.texture)
    else:
        block = options.block or 3
        p1 = 8 * block**2 if options.p1 is None else options.p1
        p2 = 32 * block**2 if options.p2 is None else options.p2
        stereo = cv2.StereoSGBM_create(low, count, block, P1=p1, P2=p2)
    if options.uniqueness is not None:
        stereo.setUniquenessRatio(options.uniqueness)
    if options.speckle_window is not None:
        stereo.setSpeckleWindowSize(options.speckle_window)
        stereo.setSpeckleRange(options.speckle_range)
    return stereo


def main():
    options = arguments()

    def match(left, right, request):
        low, high = request.min_disparity, request.max_disparity
        count = -(-(high - low + 1) // 16) * 16
        fixed = matcher(options, low, count).compute(left, right)
        found = fixed.astype(np.float32) / 16
        # OpenCV writes low - 1 for none, and looks beyond the range to fill its sixteens.
        found[(fixed < 16 * low) | (fixed > 16 * high)] = np.inf
        return found

    def start(request):
        cv2.setNumThreads(request.threads)
        return {"threads": request.threads}

    name = f"OpenCV {options.method}"
    serve(match, start=start, name=name, version=cv2.__version__, device="CPU")


if __name__ == "__main__":
    main()
