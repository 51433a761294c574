"""Pairs of recordings, bags, folders, data sets, videos and simulations."""

from __future__ import annotations

import json
import os
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

from ._extension import extension
from ._ranger import Rig

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


class Pair(NamedTuple):
    """A synchronized pair of height x width images."""

    sequence: int
    """Its number in the source, from 0."""
    stamp_ns: int
    """Middle of the left exposure."""
    left: npt.NDArray[np.uint8]
    """Grey, height x width."""
    right: npt.NDArray[np.uint8]
    name: str | None
    """Of a data set's scene."""
    is_rectified: bool
    rig: Rig | None
    """Of a rectified pair, if it is known."""
    left_color: npt.NDArray[np.uint8] | None
    """Height x width x 3, red, green, blue, if the source is in colour."""
    right_color: npt.NDArray[np.uint8] | None
    true_disparity: npt.NDArray[np.float32] | None
    """Pixels, infinite where unknown; None without a truth."""
    pose: npt.NDArray[np.float64] | None
    """4 x 4: the left camera (x right, y down, z forward) in the world (z up), metres."""


class Pairs:
    """An iterator of the pairs of a source. A pair that cannot be read is no pair: at the end, what is
    missing is in `losses`, and in a warning."""

    def __init__(self, name: str, seed: int | None, raw: bool, options: dict[str, Any]) -> None:
        self._name = name
        self._reader = extension.PairReader(name, seed, raw, json.dumps(options))
        self.notes: list[str] = self._reader.notes
        """Remarks on the source, as what it was rectified by."""
        self.losses: str | None = None
        """After the end: what is missing, in words."""
        self._is_open = True

    def __iter__(self) -> Pairs:
        return self

    def __next__(self) -> Pair:
        fields = self._reader.next() if self._is_open else None
        if fields is None:
            if self._is_open:
                self.losses = self._reader.losses()
                self.close()
                if self.losses:
                    warnings.warn(f"{self._name}: missing: {self.losses}", stacklevel=2)
            raise StopIteration
        rig = fields.pop("rig")
        return Pair(**fields, rig=None if rig is None else Rig(*rig))

    def __length_hint__(self) -> int:
        count = self._reader.pairs() if self._is_open else 0
        return NotImplemented if count is None else count

    def close(self) -> None:
        """Closes its files; there are no more pairs."""
        self._is_open = False
        self._reader.close()

    def __enter__(self) -> Pairs:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read(
    source: str | os.PathLike[str], *, seed: int | None = None, raw: bool = False, **options: Any
) -> Pairs:
    """The pairs of everything that `svl record` reads and that has an end: svl's recordings, bags of
    ROS 1 and 2, RealSense's and Foxglove's, videos, folders, data sets, "arena".

    options are those of the command line, with underscores: left="/cam0/image_raw", right=...,
    calib="stereo.yaml", truth=..., every=10. Raw images are rectified if the source has a calibration,
    or by `calib`; raw=True leaves them. seed: of a simulation.

    Raises ValueError for an unknown source or option, OSError for a file that cannot be read.
    """
    return Pairs(os.fspath(source), seed, raw, options)
