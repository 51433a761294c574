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
        focal_px * baseline_m / (disparity + doffs_px). Disparities that are not finite, which are none, and those
        beyond infinity have NaN; 0 pixels are infinitely far."""
        sums = np.asarray(disparity, np.float64) + self.doffs_px
        with np.errstate(divide="ignore"):
            distances = self.focal_px * self.baseline_m / np.abs(sums)
        return np.where(np.isfinite(sums) & (sums >= 0), distances, np.nan).astype(np.float32)

    def disparity_px(self, distance_m: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Disparities in pixels of distances in metres, as distance_m() has them; 0 and negative distances,
        which are none in depth images, have NaN."""
        distances = np.asarray(distance_m, np.float64)
        with np.errstate(divide="ignore"):
            found = self.focal_px * self.baseline_m / distances - self.doffs_px
        return np.where(distances > 0, found, np.nan).astype(np.float32)
