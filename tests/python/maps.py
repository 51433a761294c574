"""One map of disparities as other programs write it: maps.py FOLDER, which prints the files' names."""

import os
import sys

import cv2
import numpy as np
from PIL import Image

os.chdir(sys.argv[1])
NONE = np.inf
# Multiples of 1/16, so that all forms have them; 6.5 as a float has a line feed among its bytes.
disparities = np.array([[4.0, 5.5, NONE], [0.625, 6.5, 80.0]], np.float32)
line_feed = np.frombuffer(b"\x00\x00\x0a\x41", "<f4")[0]
disparities[1, 1] = line_feed
rows = np.flipud(disparities).astype("<f4").tobytes()

cv2.imwrite("opencv.pfm", disparities)
np.save("numpy.npy", disparities)
np.save("half.npy", disparities.astype(np.float16))
np.savez_compressed("numpy.npz", np.where(np.isinf(disparities), np.nan, disparities).astype(np.float64))
steps = np.where(np.isinf(disparities), 0, disparities * 256)
cv2.imwrite("opencv.png", steps.astype(np.uint16))
Image.fromarray(steps.astype(np.uint16)).save("pillow.png")
np.save("integers.npy", (steps / 16).astype(np.int16))
header = b"Pf\n3 2\n-1\n"
with open("header.pfm", "wb") as file:
    file.write(header.replace(b"\n", b"\r\n") + rows)
# The text stream of Windows puts a carriage return before each line feed.
with open("stream.pfm", "wb") as file:
    file.write((header + rows).replace(b"\n", b"\r\n"))
print("opencv.pfm numpy.npy half.npy numpy.npz opencv.png pillow.png integers.npy header.pfm stream.pfm")
