"""A robot that stops for obstacles: a pair in, the distance of the nearest cell out.

A made-up camera replaces a real one: a textured wall comes nearer by 0.2 m per pair."""

import svl_bench as svl
import numpy as np


def camera(width=320, height=240):
    """The pairs of the camera, each with its time, ns."""
    y, x = np.mgrid[:height, : width + 64].astype(np.uint32)
    wall = (((x * 0x9E3779B9 ^ y * 0x85EBCA6B) * 0xC2B2AE35) >> 24).astype(np.uint8)
    for step in range(6):
        disparity = round(328 * 0.044 / (1.5 - 0.2 * step))
        yield wall[:, :width], wall[:, disparity : disparity + width], 100_000_000 * (step + 1)


rig = svl.Rig(focal_px=328, baseline_m=0.044, cx_px=160, cy_px=120)
with svl.Ranger("v5:max_disparity=64", rig=rig) as ranger:
    for left, right, stamp_ns in camera():
        found = ranger.match(left, right, stamp_ns=stamp_ns)
        distances_m = np.where(found.state == svl.State.NEAR, 0, found.distance_m)
        nearest_m = np.fmin.reduce(distances_m, axis=None, initial=np.inf)
        print(f"nearest {nearest_m:.2f} m: {'stop' if nearest_m < 0.5 else 'go on'}")
