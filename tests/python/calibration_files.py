"""Compares two OpenCV calibrations number for number, and writes the first as XML.

calibration_files.py THEIRS OURS OUT.xml"""

import sys

import cv2
import numpy as np

theirs, ours = (cv2.FileStorage(name, cv2.FILE_STORAGE_READ) for name in sys.argv[1:3])
out = cv2.FileStorage(sys.argv[3], cv2.FILE_STORAGE_WRITE)
for name in ("image_width", "image_height"):
    assert theirs.getNode(name).real() == ours.getNode(name).real(), name
    out.write(name, int(theirs.getNode(name).real()))
for name in ("K1", "D1", "K2", "D2", "R", "T", "R1", "R2", "P1", "P2"):
    a, b = (storage.getNode(name).mat() for storage in (theirs, ours))
    assert a.shape == b.shape, (name, a.shape, b.shape)
    # Rotations are made orthonormal in the last digit.
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 if name.startswith("R") else 0, err_msg=name)
    out.write(name, a)
out.release()
