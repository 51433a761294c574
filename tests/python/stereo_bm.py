"""Runs OpenCV's StereoBM on a raw pair and writes its 16-bit disparities.

stereo_bm.py WIDTH HEIGHT DISPARITIES BLOCK PAIR OUT"""

import sys

import cv2
import numpy as np

width, height, disparities, block = map(int, sys.argv[1:5])
left, right = np.fromfile(sys.argv[5], np.uint8).reshape(2, height, width)
cv2.StereoBM_create(disparities, block).compute(left, right).astype("<i2").tofile(sys.argv[6])
