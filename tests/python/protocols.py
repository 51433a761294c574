"""The metric protocols once more, straightforwardly in numpy, as JSON.

protocols.py middeval3 ESTIMATE.pfm TRUTH.pfm MASK.png MAX_DISPARITY
protocols.py kitti ESTIMATE.png TRUTH.png"""

import json
import sys

import cv2
import numpy as np


def read_pfm(path):
    with open(path, "rb") as file:
        assert file.readline().strip() == b"Pf"
        width, height = map(int, file.readline().split())
        order = "<" if float(file.readline()) < 0 else ">"
        values = np.fromfile(file, order + "f4", width * height)
    return np.flipud(values.reshape(height, width)).astype(np.float64)


def read_kitti(path):
    return cv2.imread(path, cv2.IMREAD_UNCHANGED).astype(np.float64) / 256


def middeval3(estimate, truth, mask, max_disparity):
    estimate, truth, mask = read_pfm(estimate), read_pfm(truth), cv2.imread(mask, cv2.IMREAD_GRAYSCALE)
    judged = np.isfinite(truth) & (mask == 255)
    found = judged & np.isfinite(estimate)
    pixels = np.count_nonzero(judged)
    error = np.abs(np.clip(estimate[found], 0, float(max_disparity)) - truth[found])
    ordered = np.sort(error)
    scores = {f"bad{t}": 100 * np.count_nonzero(error > t) / pixels for t in (0.5, 1.0, 2.0, 4.0)}
    scores["invalid"] = 100 * (pixels - error.size) / pixels
    scores["totbad2.0"] = scores["bad2.0"] + scores["invalid"]
    scores["avgerr"] = error.mean()
    scores["rms"] = np.sqrt((error**2).mean())
    scores.update({f"a{q}": ordered[error.size * q // 100] for q in (50, 90, 95, 99)})
    scores["coverage"] = 100 * error.size / pixels
    scores["pixels"] = pixels
    return scores


def densify(disparity):
    """0 is none."""
    dense = disparity.copy()
    for row in dense:
        known = np.flatnonzero(row)
        if known.size:
            row[: known[0]], row[known[-1] :] = row[known[0]], row[known[-1]]
            for a, b in zip(known, known[1:]):
                row[a + 1 : b] = min(row[a], row[b])
    for column in dense.T:
        known = np.flatnonzero(column)
        if known.size:
            column[: known[0]], column[known[-1] :] = column[known[0]], column[known[-1]]
    return dense


def kitti(estimate, truth):
    estimate, truth = read_kitti(estimate), read_kitti(truth)
    judged, found = truth > 0, (truth > 0) & (estimate > 0)
    dense = densify(estimate)
    scores = {"density": 100 * np.count_nonzero(found) / np.count_nonzero(judged)}
    for suffix, disparity, pixels in (("", estimate, judged), ("_dense", dense, judged), ("_est", estimate, found)):
        error = np.abs(np.where(disparity > 0, disparity, -1) - truth)[pixels]
        for t in range(1, 6):
            scores[f"out{t}{suffix}"] = 100 * np.mean(error > t)
        scores[f"d1_all{suffix}"] = 100 * np.mean((error > 3) & (np.float32(error / truth[pixels]) > np.float64(0.05)))
    scores["avgerr"] = np.abs(estimate - truth)[found].mean()
    scores["avgerr_dense"] = np.abs(dense - truth)[judged].mean()
    return scores


protocol = {"middeval3": middeval3, "kitti": kitti}[sys.argv[1]]
print(json.dumps({name: float(score) for name, score in protocol(*sys.argv[2:]).items()}))
