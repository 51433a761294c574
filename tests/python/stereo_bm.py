"""Runs OpenCV's StereoBM on a raw pair and writes its 16-bit disparities.

stereo_bm.py WIDTH HEIGHT DISPARITIES BLOCK MIN_DISPARITY DISP12_MAX_DIFF PAIR OUT"""

import sys

import cv2
import numpy as np

width, height, disparities, block, least, difference = map(int, sys.argv[1:7])
left, right = np.fromfile(sys.argv[7], np.uint8).reshape(2, height, width)
matcher = cv2.StereoBM_create(disparities, block)
matcher.setMinDisparity(least)
matcher.setDisp12MaxDiff(difference)
matcher.compute(left, right).astype("<i2").tofile(sys.argv[8])
