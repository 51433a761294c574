"""read(): the pairs of recordings, bags, folders and cameras as arrays."""

from __future__ import annotations

import io
import json
import os
from typing import TYPE_CHECKING, Any, Iterator, NamedTuple

import numpy as np

from ._program import running, words
from ._rig import Rig

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._types import PathLike


class Pair(NamedTuple):
    """A synchronized, rectified pair."""

    sequence: int
    """Number of the pair in its source, from 0."""
    stamp_ns: int
    """Time of the left exposure, nanoseconds by the source's clock."""
    name: str | None
    """Name of a data set's scene; None of a stream."""
    left: npt.NDArray[np.uint8]
    """height x width, grey."""
    right: npt.NDArray[np.uint8]
    """height x width, grey."""
    rig: Rig | None
    """The cameras, for Ranger and match(); None if they are not known."""
    true_disparity: npt.NDArray[np.float32] | None
    """height x width, pixels, infinite where unknown; None without a truth."""

    @property
    def depth_m(self) -> npt.NDArray[np.float32] | None:
        """The truth as distances along the optical axis, height x width, metres, NaN where unknown;
        None without a truth or a rig."""
        if self.rig is None or self.true_disparity is None:
            return None
        return self.rig.distance_m(self.true_disparity)


def read(source: PathLike, **options: Any) -> Iterator[Pair]:
    """The pairs of everything that `svl score` and `svl record` read, one after another: svl's
    recordings, bags of ROS 2 and ROS 1, videos, folders of images, cameras, live topics.

    Raw pairs are rectified by the calibration of their source, as `svl score` does, or by calib="FILE".
    options: those of `svl record`, with underscores: frames=60, every=5, left="/cam0/image_raw",
    truth="/truth/depth". Memory does not grow with the number of pairs.

    Raises ValueError for wrong usage, RuntimeError if the source was not read to its end or pairs are
    missing, both with svl's message; the pairs before are good.
    """
    if "output" in options:
        raise ValueError("output: read() returns the pairs; record() writes them to a file")
    line = ["record", *words({**options, "output": "-"}), "--", os.fspath(source)]
    with running("--quiet", *line) as svl:
        pairs = svl.stdout
        assert isinstance(pairs, io.BufferedReader)
        while header := pairs.readline():
            pair = _pair(pairs, header)
            if pair is None:
                break
            yield pair


def _pair(source: io.BufferedReader, header: bytes) -> Pair | None:
    """The pair behind its header; None if the program ended within it."""
    if not header.endswith(b"\n"):
        return None
    line = json.loads(header)
    size = (line["height"], line["width"])
    left, right = np.empty((2, *size), np.uint8)
    truth = np.empty(size, "<f4") if line["truth"] else None
    for array in (left, right, truth):
        if array is not None and source.readinto(array.data) < array.nbytes:
            return None
    rig = Rig(**line["rig"]) if "rig" in line else None
    return Pair(line["sequence"], line["stamp_ns"], line.get("name"), left, right, rig, truth)
