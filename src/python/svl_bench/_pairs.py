"""read() and write(): the pairs of recordings, bags, folders and cameras as arrays."""

from __future__ import annotations

import io
import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterable, Iterator, NamedTuple, Union

import numpy as np

from ._images import image
from ._program import run, running, words
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
    """height x width, pixels, NaN where unknown; None without a truth."""

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

    Raises ValueError for wrong usage, FileNotFoundError, RuntimeError if the source was not read to its end
    or pairs are missing, with svl's message; the pairs before are good.
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
    if truth is not None:
        truth[np.isinf(truth)] = np.nan
    rig = Rig(**line["rig"]) if "rig" in line else None
    return Pair(line["sequence"], line["stamp_ns"], line.get("name"), left, right, rig, truth)


def write(
    output: PathLike,
    pairs: Iterable[Union[Pair, tuple[Any, ...]]],
    *,
    rig: Rig | None = None,
    bits: int | None = None,
    bgr: bool = False,
    scale: float | None = None,
    **options: Any,
) -> Path:
    """Writes pairs to a recording of svl, which read(), score() and the program read. Returns its path.

    pairs: those of read(), or tuples of left, right and, if it is known, the stamp in nanoseconds. rig: of
    rectified images; without it that of the first pair that has one. Raw images are rectified with
    calib="FILE". bits, bgr, scale: as in Ranger.match(). options: those of `svl record`, with underscores:
    fps=30 of pairs without stamps, force=True, compress=True, ros2=True.

    The pairs lie in files beside `output` meanwhile. Raises TypeError or ValueError for images that do not
    fit, FileNotFoundError for a folder that is not there, RuntimeError with svl's message.
    """
    target = Path(os.path.abspath(output))
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{target.parent}: no such folder")
    if options.get("calib") not in (None, "none"):
        options["calib"] = os.path.abspath(options["calib"])
    with tempfile.TemporaryDirectory(prefix=".svl-", dir=target.parent) as temporary:
        folder = Path(temporary) / "pairs"
        for name in ("cam0", "cam1", "disp"):
            (folder / name).mkdir(parents=True)
        stamps, size, has_truth = [], (0, 0), False
        for number, pair in enumerate(pairs):
            given = pair if isinstance(pair, Pair) else None
            both = pair[3:5] if given else pair[:2]
            names = (f"left of pair {number}", f"right of pair {number}")
            left, right = (image(array, name, scale) for array, name in zip(both, names))
            if left.shape[:2] != right.shape[:2]:
                raise ValueError(f"pair {number}: arrays of shapes {left.shape} and {right.shape}")
            size = left.shape[:2]
            for camera, array in (("cam0", left), ("cam1", right)):
                _write_image(folder / camera / f"{number:09}", array, bits, bgr)
            stamp = given.stamp_ns if given else pair[2] if len(pair) > 2 else None
            stamps += [] if stamp is None else [f"{int(stamp)},{number:09}.png\n"]
            if given is not None:
                rig = rig or given.rig
                if given.true_disparity is not None:
                    np.save(folder / f"disp/{number:09}.npy", given.true_disparity)
                    has_truth = True
        if not size[0]:
            raise ValueError(f"{output}: there are no pairs to write")
        if len(stamps) not in (0, number + 1):
            raise ValueError(f"{len(stamps)} of {number + 1} pairs have a stamp: give it for all, or for none")
        if stamps:
            (folder / "cam0/data.csv").write_text("".join(stamps))
        if rig is not None and "calib" not in options:
            (folder / "calib.txt").write_text(_calib(Rig(*rig), size))
        if has_truth:
            options["truth"] = "disp/*.npy:disparity=1"
        given_bits = {} if bits is None else {"bits": bits}
        line = ["record", *words({**options, **given_bits, "output": target}), "--", "pairs"]
        run(*line, folder=temporary)
    return Path(output)


def _write_image(stem: Path, array: npt.NDArray[Any], bits: int | None, bgr: bool) -> None:
    """PGM, or PPM of colour."""
    height, width = array.shape[:2]
    is_deep = array.itemsize == 2
    if array.ndim not in (2, 3) or array.ndim == 3 and (is_deep or array.shape[2] not in (3, 4)):
        raise ValueError(f"an array of shape {array.shape} and {array.dtype} is no image")
    if is_deep and bits is None:
        raise ValueError("uint16 needs bits=N, those in use of its 16: 10 of a mono10 camera")
    if array.ndim == 3:
        array = array[..., 2::-1] if bgr else array[..., :3]
    kind, ending = (b"P6", ".ppm") if array.ndim == 3 else (b"P5", ".pgm")
    with open(stem.with_suffix(ending), "wb") as file:
        file.write(b"%s %d %d %d\n" % (kind, width, height, 65535 if is_deep else 255))
        file.write(array.astype(">u2" if is_deep else np.uint8).tobytes())


def _calib(rig: Rig, size: tuple[int, ...]) -> str:
    """Middlebury's calib.txt."""
    cameras = [
        f"cam{side}=[{rig.focal_px!r} 0 {cx!r}; 0 {rig.focal_px!r} {rig.cy_px!r}; 0 0 1]\n"
        for side, cx in enumerate([rig.cx_px, rig.cx_px + rig.doffs_px])
    ]
    numbers = {"doffs": rig.doffs_px, "baseline": 1000 * rig.baseline_m, "width": size[1], "height": size[0]}
    return "".join(cameras) + "".join(f"{name}={value!r}\n" for name, value in numbers.items())
