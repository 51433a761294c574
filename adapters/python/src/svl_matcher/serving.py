"""The protocol of svl's matcher `exec`: a line of JSON and two images in, a line and disparities out."""

import inspect
import json
import os
import sys
import time
from dataclasses import dataclass
from typing import Optional

import numpy as np


@dataclass(frozen=True)
class Request:
    """What svl asks for, besides the images."""

    sequence: int
    # Disparities are searched from the one to the other, in pixels.
    min_disparity: int
    max_disparity: int
    # Columns and rows of the depth grid.
    grid: tuple
    # focal_px, cx_px, cy_px, baseline_m, doffs_px; None where the cameras are not known.
    rig: Optional[dict]


def matcher(function):
    """Serves svl with a function of two images where its file is the program; else changes nothing.

    The images are arrays of uint8, height x width, rectified. The function returns disparities in
    pixels, height x width, NaN or infinity for none: the left pixel (x, y) with disparity d shows what
    the right pixel (x - d, y) does. It may return a pair of them and the cells of the depth grid. With
    a third parameter it gets the Request.
    """
    if function.__module__ == "__main__":
        if sys.stdin is None or sys.stdin.isatty():
            name = os.path.basename(sys.argv[0])
            sys.exit(
                f"{name} answers svl on its standard input:\n"
                f'  svl score arena --algo "mine=exec:command=python3 {name}"'
            )
        serve(function)
        sys.exit(0)
    return function


def serve(function):
    """Answers svl's requests until its input ends."""
    source, target = sys.stdin.buffer, _private_stdout()
    has_request = len(inspect.signature(function).parameters) > 2
    warm = set()
    for text in iter(source.readline, b""):
        line = json.loads(text)
        size = (line["height"], line["width"])
        left, right = (_image(source, size) for _ in range(2))
        request = Request(
            line["seq"],
            line["min_disparity"],
            line["max_disparity"],
            (line["columns"], line["rows"]),
            line.get("rig"),
        )
        arguments = (left, right, request) if has_request else (left, right)
        reply, pixels = {"seq": request.sequence}, b""
        try:
            if size not in warm:
                function(*arguments)
                warm.add(size)
            start = time.perf_counter()
            answer = function(*arguments)
            reply["millis"] = 1e3 * (time.perf_counter() - start)
            disparity, cells = answer if isinstance(answer, tuple) else (answer, None)
            pixels = _pixels(disparity, size)
            if cells is not None:
                reply["cells"] = _cells(cells, request.grid)
        except Exception as error:
            # The pair's alone: the next one may go.
            words = " ".join(str(error).split())
            reply = {"seq": request.sequence, "error": f"{type(error).__name__}: {words}"}
            pixels = b""
        target.write(json.dumps(reply).encode() + b"\n" + pixels)
        target.flush()


def _private_stdout():
    """Standard output for the answers alone: what else is printed goes to standard error."""
    sys.stdout.flush()
    private = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return private


def _image(source, size):
    count = size[0] * size[1]
    pixels = source.read(count)
    if len(pixels) < count:
        sys.exit("svl's input ended within an image")
    return np.frombuffer(pixels, np.uint8).reshape(size)


def _pixels(disparity, size):
    disparity = np.asarray(disparity)
    if disparity.shape != size:
        raise ValueError(f"disparities of shape {disparity.shape}, expected {size}")
    disparity = disparity.astype("<f4")
    disparity[~np.isfinite(disparity)] = np.inf
    return disparity.tobytes()


def _cells(cells, grid):
    cells = list(cells)
    if len(cells) != grid[0] * grid[1]:
        raise ValueError(f"{len(cells)} cells, expected {grid[0]} x {grid[1]}")

    def cell(value):
        if value is None:
            return None
        disparity, probability = value if isinstance(value, (tuple, list)) else (value, None)
        if not np.isfinite(disparity):
            return None
        known = {"disparity_px": float(disparity)}
        return known if probability is None else {**known, "probability": float(probability)}

    return [cell(value) for value in cells]
