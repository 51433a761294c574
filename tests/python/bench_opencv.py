"""Times OpenCV's StereoBM and StereoSGBM (mode HH), one thread, on a pair of a recording, as JSON like `svl bench`.

    svl record arena --frames 141 -o pair.mcap && svl bench --json && python bench_opencv.py pair.mcap 80

The last pair of that recording is the one that `svl bench` matches at 320x240.
"""

import json
import sys
import time

import cv2
import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def last_pair(path):
    images = {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = ["/stereo/left/image", "/stereo/right/image"]
        for _, channel, _, message in reader.iter_decoded_messages(topics=topics):
            images[channel.topic] = message
    return [
        np.frombuffer(images[t].data, np.uint8).reshape(images[t].height, images[t].width).copy() for t in topics
    ]


def measure(name, matcher, left, right, disparities):
    times = []
    for _ in range(3):
        matcher.compute(left, right)
    while len(times) < 5 or sum(times) < 2.0:
        began = time.perf_counter()
        matcher.compute(left, right)
        times.append(time.perf_counter() - began)
    times.sort()
    height, width = left.shape
    return {
        "algo": name,
        "width": width,
        "height": height,
        "disparities": disparities,
        "threads": cv2.getNumThreads(),
        "median_ms": 1e3 * times[len(times) // 2],
        "opencv": cv2.__version__,
    }


def main():
    path, disparities = sys.argv[1], int(sys.argv[2])
    left, right = last_pair(path)
    cv2.setNumThreads(1)
    bm = cv2.StereoBM_create(disparities, 9)
    hh = cv2.StereoSGBM_create(
        0, disparities, 3, P1=8 * 9, P2=32 * 9, disp12MaxDiff=1, preFilterCap=63, uniquenessRatio=10,
        speckleWindowSize=100, speckleRange=2, mode=cv2.STEREO_SGBM_MODE_HH,
    )
    found = [measure("StereoBM", bm, left, right, disparities), measure("StereoSGBM HH", hh, left, right, disparities)]
    print(json.dumps(found, indent=2))


main()
