"""calibration(): the cameras of a file, which rectifies their images."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from ._extension import extension
from ._images import image
from ._rig import Rig

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._types import PathLike


class Calibration:
    """Two calibrated cameras.

    rig: of the rectified images, for match(), Ranger and write(); None if the file's unit is unknown.
    size: width and height of the rectified images.
    """

    def __init__(self, file: PathLike) -> None:
        self._handle = extension.CalibrationHandle(os.fspath(file))
        numbers = self._handle.rig()
        self.rig: Rig | None = None if numbers is None else Rig(*numbers)
        self.size: tuple[int, int] = self._handle.size()

    def rectify(
        self,
        left: npt.ArrayLike,
        right: npt.ArrayLike,
        *,
        bits: int | None = None,
        scale: float | None = None,
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
        """The images of a raw pair, rectified: uint8, height x width, and x 3 of colour. Options are those of
        Ranger.match(). Raises TypeError or ValueError for images that do not fit."""
        raw = [image(left, "left", scale), image(right, "right", scale)]
        if raw[0].ndim != raw[1].ndim:
            shapes = f"{raw[0].shape} and {raw[1].shape}"
            raise ValueError(f"left and right: arrays of shapes {shapes}: both grey, or both colour")
        if raw[0].ndim != 3:
            grey = self._handle.rectify(raw[0], raw[1], bits)
            return grey[0], grey[1]
        channels = []
        for at in range(min(raw[0].shape[2], raw[1].shape[2], 3)):
            sides = [np.ascontiguousarray(side[..., at]) for side in raw]
            channels.append(self._handle.rectify(sides[0], sides[1], bits))
        return np.stack([c[0] for c in channels], -1), np.stack([c[1] for c in channels], -1)

    def __repr__(self) -> str:
        return f"<svl_bench.Calibration of {self.size[0]} x {self.size[1]}, {self.rig}>"


def calibration(file: PathLike) -> Calibration:
    """The calibration in a file of OpenCV, ROS, Kalibr, EuRoC, KITTI or Middlebury, or in a folder of two.

    Raises FileNotFoundError, other OSErrors, ValueError.
    """
    return Calibration(file)
