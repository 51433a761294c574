#!/usr/bin/env python3
"""OpenCV's StereoBM and StereoSGBM for svl's matcher `exec`, and an example of its protocol.

    pip install numpy opencv-python-headless
    svl match left.png right.png -o d.pfm \\
        --algo "exec:command=python3 adapters/opencv.py sgbm --block 5"

svl starts the program once. Per pair it sends one line of JSON and the pixels of both images:

    {"width":W,"height":H,"min_disparity":a,"max_disparity":b,"seq":n,"columns":C,"rows":R,
     "rig":{"focal_px":f,"cx_px":x,"cy_px":y,"baseline_m":B,"doffs_px":o}}   (no rig: not known)
    W*H bytes of the left image, W*H bytes of the right image

and reads one line of JSON and W*H little-endian floats, +inf for none, row by row:

    {"seq":n,"millis":t}  or, and nothing after it,  {"seq":n,"error":"why"}

A program may answer the cells of the depth grid itself: "cells":[null,{"disparity_px":12.5},
{"disparity_px":12.5,"probability":0.97},...] beside millis, C*R of them, row by row, null for an
unknown one. Without, svl makes the cells of the disparities.

Standard output is the answer and nothing else; standard error appears in svl's error messages. A
left pixel (x, y) with disparity d matches (x - d, y) in the right image. At the end of the input
the program ends.
"""

import argparse
import json
import sys
import time

import cv2
import numpy as np


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


def disparities(options, line, left, right):
    low, high = line["min_disparity"], line["max_disparity"]
    count = -(-(high - low + 1) // 16) * 16
    fixed = matcher(options, low, count).compute(left, right)
    found = fixed.astype(np.float32) / 16
    # OpenCV writes low - 1 for none, and looks beyond the range to fill its sixteens.
    found[(fixed < 16 * low) | (fixed > 16 * high)] = np.inf
    return found


def main():
    options = arguments()
    source, target = sys.stdin.buffer, sys.stdout.buffer
    for text in iter(source.readline, b""):
        line = json.loads(text)
        width, height = line["width"], line["height"]
        images = (np.frombuffer(source.read(width * height), np.uint8) for _ in range(2))
        left, right = (image.reshape(height, width) for image in images)
        start = time.perf_counter()
        try:
            answer = disparities(options, line, left, right).astype("<f4").tobytes()
        except cv2.error as error:
            reply, answer = {"seq": line["seq"], "error": str(error)}, b""
        else:
            reply = {"seq": line["seq"], "millis": 1e3 * (time.perf_counter() - start)}
        target.write(json.dumps(reply).encode() + b"\n" + answer)
        target.flush()


if __name__ == "__main__":
    main()
