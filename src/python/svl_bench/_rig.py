"""The geometry of two rectified cameras."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt


class Rig(NamedTuple):
    """Two rectified cameras: focal length and principal point of the left one in pixels, baseline in
    metres, and the right principal point minus the left one, along x, in pixels."""

    focal_px: float
    baseline_m: float
    cx_px: float = 0.0
    cy_px: float = 0.0
    doffs_px: float = 0.0

    def distance_m(self, disparity: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Distances along the optical axis in metres, of disparities in pixels of any shape:
        focal_px * baseline_m / (disparity + doffs_px). Infinite disparities, which are none, and those
        beyond infinity have NaN; 0 pixels are infinitely far."""
        sums = np.asarray(disparity, np.float64) + self.doffs_px
        with np.errstate(divide="ignore"):
            distances = self.focal_px * self.baseline_m / np.abs(sums)
        return np.where(np.isfinite(sums) & (sums >= 0), distances, np.nan).astype(np.float32)
