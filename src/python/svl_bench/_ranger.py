"""Matching of pairs: match() for one, Ranger for those of a camera."""

from __future__ import annotations

import enum
import os
import threading
from collections import OrderedDict
from typing import TYPE_CHECKING, Any, NamedTuple, Sequence

import numpy as np

from ._extension import extension
from ._images import image
from ._rig import Rig

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._types import PathLike

    Image = npt.ArrayLike
    Floats = npt.NDArray[np.float32]
    Codes = npt.NDArray[np.uint8]

REASONS: list[str] = extension.REASONS
"""Names of the codes in Match.reason and Match.reasons: valid, border, untextured, ..."""


class State(enum.IntEnum):
    """State of a cell."""

    UNKNOWN = 0
    KNOWN = 1
    TOO_CLOSE = 2
    """Nearer than the range of disparities (filter too-close)."""
    NEAR = 3
    """Something is nearer than 0.5 m, and the cell has no distance."""
    FAR = 4
    """Known to be at infinity."""


class Match(NamedTuple):
    """The answer for a pair. The first ten are arrays of cells, rows x columns from the top left; the
    next two have the height and width of the rectified images."""

    distance_m: Floats
    """float32, metres along the optical axis; infinite at infinity; NaN if unknown or without a rig."""
    disparity_px: Floats
    """float32, pixels; NaN if unknown."""
    probability: Floats
    """float32, 0 to 1, that the distance is right (v5), or of State.NEAR that something is near."""
    valid_fraction: Floats
    """float32, fraction of the cell's pixels with a disparity, 0 to 1."""
    state: Codes
    """uint8, of State."""
    reason: Codes
    """uint8, index into REASONS: why a cell is unknown."""
    level: Codes
    """uint8, size of the image that decided the cell (v5): 0 the pair's, 1 half of it, ..."""
    near_distance_m: Floats
    """float32, metres: the nearer of two surfaces, or what is seen in an unknown cell; NaN without one. Of
    v5's small cells (24 x 12)."""
    near_px: Floats
    """float32, its disparity, pixels."""
    surface_probability: Floats
    """float32, 0 to 1, that the cell has a surface there."""
    disparity: Floats
    """float32, pixels: the left pixel (x, y) shows what the right one (x - d, y) does; NaN: none.
    v5 decides cells by more than this map."""
    reasons: Codes
    """uint8, index into REASONS: why a pixel has no disparity."""
    rig: Rig | None
    """Of the rectified images; None if it is not known."""

    @property
    def depth_m(self) -> Floats:
        """float32, height x width, metres along the optical axis, infinite for 0 pixels of a rig without
        doffs_px, NaN where unknown or without a rig."""
        if self.rig is None:
            return np.full_like(self.disparity, np.nan)
        return self.rig.distance_m(self.disparity)

    def points(self) -> Floats:
        """float32, N x 3, metres: the pixels with a finite distance, row by row, in the left camera: x to the
        right, y down, z forward. Raises ValueError without a rig."""
        if self.rig is None:
            raise ValueError("points: the rig is not known; match with rig= or calibration=")
        depth = self.depth_m
        y, x = np.nonzero(np.isfinite(depth))
        z = depth[y, x]
        rays = [(x - self.rig.cx_px) / self.rig.focal_px, (y - self.rig.cy_px) / self.rig.focal_px]
        return np.stack([rays[0] * z, rays[1] * z, z], axis=-1).astype(np.float32)


class Ranger:
    """A matcher with its memory and threads, for the pairs of a camera.

    algorithm: as on the command line, "v5:max_disparity=64". rig: a Rig of rectified images, or its
    numbers in a dictionary. calibration: the file of raw images (OpenCV, ROS, Kalibr, ...), which are
    rectified by it. filters: a file of `svl train filter`, or several. columns, rows: of the cells, up
    to 64 each. threads: 0 is one per core. Several threads of Python may use one, in turns; after
    os.fork() each process needs its own.

    Raises ValueError, or OSError for a file that cannot be read. match() raises MemoryError where images
    need more than there is.
    """

    def __init__(
        self,
        algorithm: str = "v5",
        *,
        rig: Rig | dict[str, float] | None = None,
        calibration: str | os.PathLike[str] | None = None,
        filters: PathLike | Sequence[PathLike] = (),
        columns: int = 5,
        rows: int = 3,
        threads: int = 0,
    ) -> None:
        self.algorithm = algorithm
        path = None if calibration is None else os.fspath(calibration)
        files = _files(filters)
        self._handle = extension.RangerHandle(
            algorithm, _numbers(rig), path, files, columns, rows, threads
        )
        numbers = self._handle.rig()
        self.rig: Rig | None = None if numbers is None else Rig(*numbers)

    def match(
        self,
        left: Image,
        right: Image,
        *,
        stamp_ns: int | None = None,
        bits: int | None = None,
        bgr: bool = False,
        scale: float | None = None,
    ) -> Match:
        """Matches a pair of numpy arrays, or of what np.asarray() makes arrays of.

        left, right: height x width of uint8 or uint16, or height x width x 3 or 4 of uint8 in red, green,
        blue. bits: those in use of uint16, 8 to 16, which the array does not say (mono10: 10, mono12: 12);
        required there. bgr: blue comes first, as in OpenCV's images. scale: factor of floats to 0..255;
        required there. Arrays are copied only if pixels have gaps, or rows go backwards. stamp_ns: time of the
        exposure by any clock. v5 uses the cells of earlier pairs, unless more than a second has passed or
        the clock does not rise; without stamps all of them.

        Raises TypeError or ValueError for images that do not fit, and the next pair may go on. Ctrl-C is
        answered at once.
        """
        left, right = image(left, "left", scale), image(right, "right", scale)
        arrays = self._handle.match_pair(left, right, stamp_ns, bits, bgr)
        return Match._make([*arrays, self.rig])

    def reset(self) -> None:
        """Forgets the earlier pairs: the next one is the first of another scene."""
        self._handle.reset()

    def close(self) -> None:
        """Ends its threads; it can be used no more."""
        self._handle.close()

    def __enter__(self) -> Ranger:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"svl_bench.Ranger({self.algorithm!r})"


def instruction_set() -> str:
    """The instruction set in use: avx512, avx2, portable or neon. Results are equal on all."""
    return extension.instruction_set()


def _numbers(rig: Rig | dict[str, float] | None) -> Rig | None:
    if rig is None:
        return None
    return Rig(**rig) if isinstance(rig, dict) else Rig(*rig)


def _files(files: PathLike | Sequence[PathLike]) -> list[str]:
    """One path, or several."""
    several = [files] if isinstance(files, (str, os.PathLike)) else files
    return [os.fspath(file) for file in several]


_MAX_IDLE = 4
_idle: OrderedDict[Any, Ranger] = OrderedDict()
_lock = threading.Lock()


def _forget() -> None:
    """After a fork: threads are not copied, and the lock may be held by one."""
    global _lock
    _lock = threading.Lock()
    _idle.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def match(
    left: Image,
    right: Image,
    algorithm: str = "v5",
    *,
    rig: Rig | dict[str, float] | None = None,
    calibration: str | os.PathLike[str] | None = None,
    filters: PathLike | Sequence[PathLike] = (),
    columns: int = 5,
    rows: int = 3,
    threads: int = 0,
    bits: int | None = None,
    bgr: bool = False,
    scale: float | None = None,
) -> Match:
    """Matches one pair: no memory of earlier ones. Options are those of Ranger and Ranger.match().

    Memory and threads of the last few kinds of calls are kept, so that a loop costs no more than one
    over a Ranger.
    """
    files = _files(filters)
    path = None if calibration is None else os.fspath(calibration)
    read = [path, *files] if path else files
    # No matcher is kept for a folder or a list of files: it is not known which were read.
    is_kept = all(map(os.path.isfile, read))
    versions = [_version(file) for file in read] if is_kept else []
    key = (algorithm, _numbers(rig), path, *files, *versions, columns, rows, threads)
    with _lock:
        ranger = _idle.pop(key, None) if is_kept else None
    if ranger is None:
        ranger = Ranger(
            algorithm,
            rig=rig,
            calibration=path,
            filters=files,
            columns=columns,
            rows=rows,
            threads=threads,
        )
    else:
        ranger.reset()
    found = ranger.match(left, right, bits=bits, bgr=bgr, scale=scale)
    with _lock:
        if is_kept:
            _idle[key] = ranger
        oldest = _idle.popitem(last=False)[1] if len(_idle) > _MAX_IDLE else None
    if oldest is not None:
        oldest.close()
    return found


def _version(file: str) -> tuple[str, int, int]:
    status = os.stat(file)
    return os.path.realpath(file), status.st_mtime_ns, status.st_size
