"""evaluate(): how good a disparity map is."""

from __future__ import annotations

import json
import os
import tempfile
from typing import TYPE_CHECKING, Any

import numpy as np

from ._program import run, words
from ._rig import Rig

if TYPE_CHECKING:
    import numpy.typing as npt


def evaluate(
    disparity: npt.ArrayLike,
    truth: npt.ArrayLike,
    *,
    rig: Rig | None = None,
    protocol: str = "middeval3",
    mask: npt.ArrayLike | None = None,
    disparity_scale: float | None = None,
    estimate_scale: float | None = None,
    **options: Any,
) -> dict[str, float | None]:
    """The numbers of `svl eval` for a disparity map and its truth, by a benchmark's protocol: middeval3,
    middlebury-v2, eth3d, kitti12, kitti15.

    disparity, truth: height x width, pixels; NaN, infinite and negative ones are none. Rig.disparity_px()
    makes them of depths in metres. Those of 8 and 16 bits, 0 being none, need disparity_scale=, the factor
    of both, 256 for KITTI's, or estimate_scale=, that of `disparity`, 16 for OpenCV's. mask: true where
    pixels are scored. options: those of `svl eval`, with underscores: max_disparity=64, object_map="obj.png".

    Fractions are in per cent, errors in pixels; None is a division by zero. With a rig also those of the
    distances of pixels known in both: rmse_m and median_error_m, and abs_rel, their mean as a fraction of
    the distance. Raises TypeError or ValueError for maps that do not fit, FileNotFoundError.
    """
    found = _map("disparity", disparity, estimate_scale or disparity_scale)
    true = _map("truth", truth, disparity_scale)
    if mask is not None:
        if np.shape(mask) != true.shape:
            raise ValueError(f"mask: an array of shape {np.shape(mask)}, the truth has {true.shape}")
        true = np.where(np.asarray(mask, bool), true, np.float32(np.nan))
    # Where svl runs in the folder of the maps, messages have their names alone.
    given = {n: os.path.abspath(v) if isinstance(v, str) else v for n, v in options.items()}
    line = ["eval", *words({**given, "protocol": protocol}), "--json", "--", "disparity.npy", "truth.npy"]
    with tempfile.TemporaryDirectory(prefix="svl-") as folder:
        for file, array in zip(line[-2:], (found, true)):
            np.save(os.path.join(folder, file), array)
        try:
            numbers: dict[str, Any] = json.loads(run(*line, folder=folder)[1])
        except RuntimeError as error:
            raise ValueError(str(error)) from None
    scores = {name: n for name, n in numbers.items() if n is None or isinstance(n, (int, float))}
    return scores if rig is None else {**scores, **_distances(rig, found, true)}


def _map(name: str, given: npt.ArrayLike, scale: float | None) -> npt.NDArray[np.float32]:
    """Disparities in pixels, NaN for none."""
    if isinstance(given, np.ma.MaskedArray):
        given = np.ma.filled(given, 0 if given.dtype.kind in "ui" else np.nan)
    array: npt.NDArray[Any] = np.asarray(given)
    if array.dtype.kind not in "uif":
        raise TypeError(f"{name}: an array of {array.dtype}, expected numbers")
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    if array.ndim != 2 or array.size == 0:
        raise ValueError(f"{name}: an array of shape {array.shape}, expected height x width")
    if array.dtype.kind != "f" and array.itemsize <= 2:
        if scale is None:
            factor = "the factor of its disparities: disparity_scale=, or estimate_scale="
            raise ValueError(f"{name}: an array of {array.dtype} does not say {factor}")
        array = np.where(array > 0, array / scale, np.nan)
    return np.where(np.isfinite(array) & (array >= 0), array, np.nan).astype(np.float32)


def _distances(
    rig: Rig, disparity: npt.NDArray[np.float32], truth: npt.NDArray[np.float32]
) -> dict[str, float | None]:
    if disparity.shape != truth.shape:
        raise ValueError(f"rig: maps of {disparity.shape} and {truth.shape}, expected equal ones")
    found, true = (rig.distance_m(array).astype(np.float64) for array in (disparity, truth))
    is_known = np.isfinite(found) & np.isfinite(true)
    errors, true = np.abs(found - true)[is_known], true[is_known]
    numbers: dict[str, float | None] = dict.fromkeys(["rmse_m", "median_error_m", "abs_rel"])
    if len(true):
        values = [np.sqrt(np.mean(errors**2)), np.median(errors), np.mean(errors / true)]
        numbers = {name: float(value) for name, value in zip(numbers, values)}
    return numbers
