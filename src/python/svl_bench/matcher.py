#!/usr/bin/env python3
"""Stereo matchers in Python for svl, which starts them as programs.

A matcher is a function of two numpy arrays in a file of its own:

    # mine.py
    import numpy as np
    from svl_bench.matcher import matcher

    @matcher
    def mine(left, right):                  # uint8, height x width, rectified
        return np.full(left.shape, 16.0)    # disparity in pixels; NaN or inf: none

    svl score arena --algo v5 --algo "mine=exec:command=python3 mine.py"

This module is one file, and needs numpy alone. It is part of the package svl_bench, whose other modules it
does not load. Without the wheel, in the folder of your own file:

    mkdir svl_bench
    svl algos exec --example python > svl_bench/matcher.py
"""

from __future__ import annotations

import argparse
import inspect
import io
import json
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Callable, Iterable, Sequence

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    Bytes = npt.NDArray[np.uint8]
    Floats = npt.NDArray[np.float32]
    Axis = tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Floats]
    Line = dict[str, Any]

__version__ = "0.1.0"


# --- Matchers ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Request:
    """The request for one pair, besides its images.

    sequence: number of the pair in its run. name: name of the pair, if it has one. min_disparity,
    max_disparity: range of the search in pixels, both included. grid: columns and rows of the depth
    grid. threads: limit on threads. rig: focal_px, cx_px, cy_px, baseline_m and doffs_px; None if the
    cameras are not known.
    """

    sequence: int
    name: str | None
    min_disparity: int
    max_disparity: int
    grid: tuple[int, int]
    threads: int
    rig: dict[str, float] | None


def matcher(function: Callable[..., Any] | None = None, **options: Any) -> Callable[..., Any]:
    """Serves svl with a function of two images if its file is the program; else changes nothing.

    The images are arrays of uint8, height x width, rectified. The function returns disparities in
    pixels, height x width, NaN or infinity for none: the left pixel (x, y) with disparity d shows what
    the right pixel (x - d, y) does. It may return a tuple of them and the cells of the depth grid, row
    by row: None for an unknown one, a disparity, or a tuple of disparity and probability. With a third
    parameter it gets the Request. For the options, as in @matcher(color=True), see serve().
    """
    if function is None:
        return lambda function: matcher(function, **options)
    if function.__module__ == "__main__":
        if sys.stdin is None or sys.stdin.isatty():
            name = os.path.basename(sys.argv[0])
            sys.exit(
                f"{name} answers svl on its standard input:\n"
                f'  svl score arena --algo "mine=exec:command=python3 {name}"'
            )
        serve(function, **options)
        sys.exit(0)
    return function


def serve(
    function: Callable[..., Any],
    *,
    color: bool = False,
    batch: int = 1,
    start: Callable[[Request], dict[str, Any] | None] | None = None,
    prepare: Callable[..., Sequence[Any]] | None = None,
    **hello: Any,
) -> None:
    """Answers svl's requests until its input ends.

    color: images are height x width x 3, red, green, blue. batch: limit on pairs at once; above 1 the
    function gets and returns arrays with one more dimension in front, and gets a list of requests.
    start(request) is called before the first pair; the dictionary that it returns is added to hello.
    prepare(left, right) makes the function's arguments, and is timed apart.
    hello: name, version, device, threads, isa, model (a hash), for the run's manifest.
    """
    source, target = open(0, "rb", closefd=False), _private_stdout()
    with_requests = prepare is None and len(inspect.signature(function).parameters) > 2
    is_first = True
    warm: set[tuple[tuple[int, int], int]] = set()
    while lines := _read_batch(source):
        pairs = [_read_pair(source, lines[0])]
        # The next line of a batch comes after the images of the last.
        while len(pairs) < lines[0].get("batch", 1):
            lines.append(json.loads(source.readline()))
            pairs.append(_read_pair(source, lines[-1]))
        requests = [_request(line) for line in lines]
        if is_first:
            is_first = False
            started = start(requests[0]) if start else None
            described = {"color": color, "batch": batch, **hello, **(started or {})}
            _write(target, {"hello": {k: v for k, v in described.items() if v is not None}})
            continue
        arguments: Sequence[Any] = [np.stack(side) if batch > 1 else side[0] for side in zip(*pairs)]
        if with_requests:
            arguments = [*arguments, requests if batch > 1 else requests[0]]
        size = (lines[0]["height"], lines[0]["width"])
        replies: list[tuple[Line, bytes | memoryview]] = []
        try:
            # The first of a size sets up memory, and is not timed.
            for _ in range(1 if (size, len(pairs)) in warm else 2):
                began = time.perf_counter()
                given = prepare(*arguments) if prepare else arguments
                prepared = time.perf_counter()
                answer = function(*given)
                ended = time.perf_counter()
            warm.add((size, len(pairs)))
            millis = {"millis": 1e3 * (ended - began) / len(pairs)}
            if prepare:
                millis["preparing_millis"] = 1e3 * (prepared - began) / len(pairs)
            disparities, cells = answer if isinstance(answer, tuple) else (answer, None)
            if batch == 1:
                disparities, cells = [disparities], None if cells is None else [cells]
            if len(disparities) != len(pairs):
                raise ValueError(f"{len(disparities)} maps of disparities, expected {len(pairs)}")
            for i, request in enumerate(requests):
                reply = {"seq": lines[i]["seq"], **millis}
                if cells is not None:
                    reply["cells"] = _cells(cells[i], request.grid)
                replies.append((reply, _pixels(disparities[i], size)))
        except Exception as error:
            # The pair's alone: the next one may go.
            told = memory_error(error) if prepare else error
            words = f"{type(told).__name__}: {' '.join(str(told).split())}"
            replies = [({"seq": line["seq"], "error": words}, b"") for line in lines]
        for reply, pixels in replies:
            _write(target, reply, pixels)


def _private_stdout() -> BinaryIO:
    """Standard output for the answers alone: what else is printed goes to standard error."""
    sys.stdout.flush()
    private: BinaryIO = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return private


def _read_batch(source: io.BufferedReader) -> list[Line]:
    line = source.readline()
    return [json.loads(line)] if line else []


def _read_pair(source: io.BufferedReader, line: Line) -> tuple[Bytes, Bytes]:
    shape: tuple[int, ...] = (line["height"], line["width"])
    if line["channels"] > 1:
        shape = (*shape, line["channels"])
    images = np.empty((2, *shape), np.uint8)
    if source.readinto(images.data.cast("B")) < images.nbytes:
        sys.exit("svl's input ended within an image")
    return images[0], images[1]


def _request(line: Line) -> Request:
    return Request(
        line["sequence"],
        line.get("name"),
        line["min_disparity"],
        line["max_disparity"],
        (line["columns"], line["rows"]),
        line["threads"],
        line.get("rig"),
    )


def _write(target: BinaryIO, reply: Line, pixels: bytes | memoryview = b"") -> None:
    for data in (json.dumps(reply).encode() + b"\n", pixels):
        part = memoryview(data)
        while part.nbytes:
            part = part[target.write(part) :]


def _pixels(disparity: Any, size: tuple[int, int]) -> memoryview:
    if isinstance(disparity, np.ma.MaskedArray):
        disparity = np.ma.filled(disparity.astype(np.float32), np.inf)
    disparity = np.asarray(disparity)
    if disparity.dtype.kind not in "biuf":
        raise TypeError(f"disparities of type {disparity.dtype}, expected numbers")
    if disparity.shape != size:
        raise ValueError(f"disparities of shape {disparity.shape}, expected {size}")
    # As little-endian floats; a copy only where something has to change.
    disparity = np.ascontiguousarray(disparity, "<f4")
    finite = np.isfinite(disparity)
    if not finite.all():
        disparity = np.where(finite, disparity, np.float32(np.inf))
    return memoryview(disparity.data).cast("B")


def _cells(cells: Iterable[Any], grid: tuple[int, int]) -> list[dict[str, float] | None]:
    cells = list(cells)
    if len(cells) != grid[0] * grid[1]:
        raise ValueError(f"{len(cells)} cells, expected {grid[0]} x {grid[1]}")

    def cell(value: Any) -> dict[str, float] | None:
        if value is None:
            return None
        disparity, probability = value if isinstance(value, (tuple, list)) else (value, None)
        if not np.isfinite(disparity):
            return None
        known = {"disparity_px": float(disparity)}
        if probability is None:
            return known
        if not 0 <= probability <= 1:
            raise ValueError(f"a cell's probability is {probability}, expected 0 to 1")
        return {**known, "probability": float(probability)}

    return [cell(value) for value in cells]


# --- Networks ---------------------------------------------------------------------------------

NORMALISATIONS: dict[str, tuple[Any, Any, Any]] = {
    # Factor, mean and standard deviation by channel.
    "raw": (1, 0, 1),
    "unit": (1 / 255, 0, 1),
    "signed": (2 / 255, 1, 1),
    "imagenet": (1 / 255, (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)),
}


def network_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of Network to a parser."""
    add = parser.add_argument
    add("--channels", choices=["grey", "rgb", "bgr"], help="of its images (default: as the model says, "
        "red first)")  # fmt: skip
    add("--normalise", choices=NORMALISATIONS, default="raw", help="raw: 0 to 255 (default); unit: 0 to "
        "1; signed: -1 to 1; imagenet: by ImageNet's mean and standard deviation")  # fmt: skip
    add("--multiple", type=int, default=32, help="width and height are padded to multiples of this, at "
        "the right and below, by the last pixels (default 32)")  # fmt: skip
    add("--size", type=_size, metavar="WxH", help="images are resized to this; disparities are scaled "
        "back")  # fmt: skip
    add("--output", help="name or number of the disparity (default: named like one, else the largest, of "
        "equal ones the last)")  # fmt: skip
    add("--confidence", help="name or number of an output with each pixel's confidence")
    add("--min-confidence", type=float, default=0.5, help="pixels below have no disparity (default 0.5)")
    add("--scale", default="1", help="factor of its disparities; 'width' where they are shares of it")
    add("--negative", action="store_true", help="its disparities are negative, as horizontal flow")
    add("--batch", type=int, default=1, help="pairs at once (default 1)")
    add("--device", choices=["auto", "cpu", "cuda"], default="auto", help="default: cuda where it is")


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise ValueError(text)
    return int(height), int(width)


class Network:
    """Inputs of a network from pairs of images, and disparities from its outputs: layout, normalisation,
    padding, resizing. `options` are those of network_options(); `channels` (1 or 3) is the model's
    number, which the option --channels replaces."""

    def __init__(self, options: argparse.Namespace, channels: int) -> None:
        self.options = options
        self.channels = {"grey": 1, "rgb": 3, "bgr": 3, None: channels}[options.channels]

    def inputs(self, images: npt.NDArray[Any], into: Floats | None = None) -> Floats:
        """Images N x H x W [x 3] as float32, N x C x H' x W'; into an earlier result, if it has their size,
        as new memory costs as much as the rest."""
        planes = np.moveaxis(images, -1, 1) if images.ndim == 4 else images[:, None]
        if planes.shape[1] not in (1, self.channels):
            planes = np.ascontiguousarray(planes).mean(1, dtype=np.float32, keepdims=True)
        old, (new, whole) = planes.shape[2:], self._sizes(planes.shape[2:])
        planes = np.broadcast_to(planes, (len(planes), self.channels, *old))
        if self.options.channels == "bgr":
            planes = planes[:, ::-1]
        shape = (len(planes), self.channels, *whole)
        padded = np.empty(shape, np.float32) if into is None or into.shape != shape else into
        # By channel, for the cache.
        for channel, (factor, mean, deviation) in enumerate(zip(*self.statistics())):
            inner = padded[:, channel, : new[0], : new[1]]
            plane = inner if old == new else np.empty((len(planes), *old), np.float32)
            plane[:] = planes[:, channel]
            plane *= factor
            plane -= mean
            plane /= deviation
            if plane is not inner:
                inner[:] = resized(plane, new)
        padded[:, :, new[0] :] = padded[:, :, new[0] - 1 : new[0]]
        padded[..., new[1] :] = padded[..., new[1] - 1 : new[1]]
        return padded

    def statistics(self) -> Floats:
        """Factor, mean and deviation, each C x 1 x 1."""
        found = np.array([np.broadcast_to(row, 3) for row in NORMALISATIONS[self.options.normalise]])
        if self.channels == 1:
            found = found.mean(1, keepdims=True)
        found = found[:, ::-1] if self.options.channels == "bgr" else found
        return found.astype(np.float32)[..., None, None]

    def axes(self, size: Sequence[int]) -> list[Axis]:
        """nearest() of the inputs' rows and columns, padding included, for images of a size."""
        inner, whole = self._sizes(size)
        rows, columns = (nearest(*each) for each in zip(size, inner, whole))
        return [(rows[0], rows[1], rows[2][:, None]), columns]

    def _sizes(self, size: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Of inputs from images of a size, without and with padding."""
        inner = tuple(self.options.size or size)
        return inner, tuple(n + -n % self.options.multiple for n in inner)

    def disparities(self, outputs: Any, size: tuple[int, ...]) -> Floats:
        """Disparities N x H x W from the outputs (an array, or lists and dictionaries of them) for images
        of the size H x W."""
        maps = {name: _planes(array) for name, array in _flat(outputs)}
        if not maps:
            raise ValueError("the network has no output that is a map")
        name = self._choice(maps, self.options.output, "disp")
        found = self._unpadded(maps[name], size, is_length=True)
        found = found * (size[1] if self.options.scale == "width" else float(self.options.scale))
        if self.options.negative:
            found = -found
        if self.options.confidence is not None:
            name = self._choice(maps, self.options.confidence, "conf")
            confidence = self._unpadded(maps[name], size, is_length=False)
            found = np.where(confidence < self.options.min_confidence, np.inf, found)
        return found

    def _choice(self, maps: dict[str, Floats], wanted: str | None, like: str) -> str:
        names = list(maps)
        if wanted is None:
            named = [name for name in names if like in name.lower()] or names
            return max(named, key=lambda name: (maps[name].shape[-1], names.index(name)))
        if wanted in maps:
            return wanted
        if wanted.lstrip("-").isdigit() and -len(names) <= int(wanted) < len(names):
            return names[int(wanted)]
        raise ValueError(f"no output {wanted}; there are {', '.join(names)}")

    def _unpadded(self, maps: Floats, size: tuple[int, ...], is_length: bool) -> Floats:
        inner, padded = self._sizes(size)
        # Of a coarser level of a pyramid, disparities are in its own pixels.
        if maps.shape[1:] != padded:
            maps = resized(maps, padded) * (padded[1] / maps.shape[2] if is_length else 1)
        maps = maps[:, : inner[0], : inner[1]]
        if inner != size:
            maps = resized(maps, size) * (size[1] / inner[1] if is_length else 1)
        return maps


def _flat(outputs: Any) -> list[tuple[str, Any]]:
    """Outputs by name, of lists and dictionaries of them too."""
    pairs: Iterable[tuple[Any, Any]]
    if isinstance(outputs, dict):
        pairs = outputs.items()
    elif isinstance(outputs, (list, tuple)):
        pairs = enumerate(outputs)
    else:
        return [("0", outputs)]
    flat: list[tuple[str, Any]] = []
    for name, output in pairs:
        if isinstance(output, (dict, list, tuple)):
            flat += [(f"{name}.{inner}", array) for inner, array in _flat(output)]
        else:
            flat.append((str(name), output))
    return [(name, array) for name, array in flat if np.ndim(array) >= 2 and np.shape(array)[-1] > 1]


def _planes(array: Any) -> Floats:
    """N x H x W of an output: the first channel, which of a flow is the horizontal one."""
    maps: Floats = np.asarray(array, np.float32)
    return maps[None] if maps.ndim == 2 else maps[:, 0] if maps.ndim == 4 else maps


def nearest(old: int, new: int, whole: int) -> Axis:
    """For each pixel of an axis resized from old to new and padded to whole, the two that it is between,
    and the share of the second; pixels are areas, as in PyTorch's align_corners=False."""
    at = np.clip((np.arange(whole).clip(max=new - 1) + 0.5) * old / new - 0.5, 0, old - 1)
    low = at.astype(int)
    return low, np.minimum(low + 1, old - 1), (at - low).astype(np.float32)


def resized(planes: Floats, size: Sequence[int]) -> Floats:
    """Planes of H x W, resized bilinearly."""
    rows, columns = (nearest(old, new, new) for old, new in zip(planes.shape[-2:], size))
    found = np.empty((*planes.shape[:-2], *size), planes.dtype)
    # A few rows at a time stay in the cache.
    for plane, target in zip(planes.reshape(-1, *planes.shape[-2:]), found.reshape(-1, *size)):
        for y in range(0, size[0], 64):
            low, high, share = (part[y : y + 64] for part in rows)
            target[y : y + 64] = _blended(_blended(plane, 0, low, high, share[:, None]), 1, *columns)
    return found


def _blended(plane: Floats, axis: int, low: Any, high: Any, share: Any) -> Floats:
    # With another mode, numpy checks the indices first.
    found: Floats = np.take(plane, low, axis, mode="clip")
    if share.any():
        other = np.take(plane, high, axis, mode="clip")
        found *= 1 - share
        other *= share
        found += other
    return found


def file_hash(path: str | Path) -> str:
    """The first half of a file's SHA-256, hexadecimal."""
    import hashlib

    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:32]


def memory_error(error: BaseException) -> BaseException:
    """The error; if memory ran out, a MemoryError with the cure."""
    words = str(error)
    is_memory = isinstance(error, MemoryError)
    for sign in ("out of memory", "Failed to allocate", "bad_alloc", "can't allocate"):
        is_memory |= sign.lower() in words.lower()
    if not is_memory:
        return error
    words = " ".join(words.split())[:120]
    return MemoryError(f"{words}: too little memory; a smaller --size or --batch, or --device cpu")


if __name__ == "__main__":
    # Run as a program, it is a slow example: the best of all disparities by absolute differences.
    @matcher(name="example", version=__version__)
    def example(left: Bytes, right: Bytes, request: Request) -> Floats:
        wide = left.astype(np.float32)
        best = np.full(left.shape, np.inf, np.float32)
        found = np.full(left.shape, np.nan, np.float32)
        for disparity in range(max(request.min_disparity, 0), request.max_disparity + 1):
            moved = np.full(left.shape, np.inf, np.float32)
            moved[:, disparity:] = right[:, : right.shape[1] - disparity]
            sums = np.abs(wide - moved)
            for axis in (0, 1):
                sums = sum(np.roll(sums, step, axis) for step in range(-4, 5))
            better = sums < best
            best[better] = sums[better]
            found[better] = disparity
        return found
