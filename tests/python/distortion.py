"""Points, maps and images of OpenCV's distortion models.

distortion.py CASES OUT

CASES has seven lines for each case: the model; width and height; fx fy cx cy; the coefficients;
the rotation into the rectified frame, row by row; focal length, cx and cy of the rectified camera;
the directions, x and y of each. OUT has for each case, as doubles: the pixels of the directions,
the directions of these pixels, the source of each rectified pixel, x of all and then y, and the
rectified image. Prints the time of the maps in milliseconds, a line for each case."""

import sys
import time

import cv2
import numpy as np

lines = open(sys.argv[1]).read().splitlines()
exact = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 1000, 1e-14)
out = open(sys.argv[2], "wb")
for i in range(0, len(lines), 7):
    model = lines[i]
    size, lens, d, r, new, points = (
        np.array(line.split(), float) for line in lines[i + 1 : i + 7]
    )
    width, height = map(int, size)
    k = np.array([[lens[0], 0, lens[2]], [0, lens[1], lens[3]], [0, 0, 1]])
    rectified = np.array([[new[0], 0, new[1]], [0, new[0], new[2]], [0, 0, 1]])
    r, points = r.reshape(3, 3), points.reshape(-1, 1, 2)
    begin = time.perf_counter()
    if model == "equidistant":
        maps = cv2.fisheye.initUndistortRectifyMap(
            k, d, r, rectified, (width, height), cv2.CV_32FC1
        )
    else:
        maps = cv2.initUndistortRectifyMap(
            k, d, r, rectified, (width, height), cv2.CV_32FC1
        )
    print(1000 * (time.perf_counter() - begin))
    if model == "equidistant":
        pixels = cv2.fisheye.distortPoints(points, k, d)
        back = cv2.fisheye.undistortPoints(pixels, k, d, criteria=exact)
    else:
        rays = np.concatenate([points, np.ones((len(points), 1, 1))], axis=2)
        pixels = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), k, d)[0]
        back = cv2.undistortPoints(pixels, k, d, criteria=exact)
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    raw = np.uint8(np.rint(127 + 60 * np.sin(x / 25) + 60 * np.cos(y / 20)))
    image = cv2.remap(raw, *maps, cv2.INTER_LINEAR)
    for values in (pixels, back, *maps, image):
        values.astype("<f8").tofile(out)
