"""The extension module, in Rust; svl_bench is the interface."""

from typing import Any

import numpy as np
import numpy.typing as npt

__version__: str
REASONS: list[str]

def instruction_set() -> str:
    """The instruction set in use: avx512, avx2, portable or neon."""

class RangerHandle:
    def __init__(
        self,
        algorithm: str,
        rig: tuple[float, float, float, float, float] | None,
        calibration: str | None,
        filters: list[str],
        columns: int,
        rows: int,
        threads: int,
    ) -> None: ...
    def match_pair(
        self,
        left: npt.NDArray[np.uint8] | npt.NDArray[np.uint16],
        right: npt.NDArray[np.uint8] | npt.NDArray[np.uint16],
        stamp_ns: int | None,
        bits: int | None,
        is_bgr: bool,
    ) -> list[npt.NDArray[Any]]: ...
    def rig(self) -> tuple[float, float, float, float, float] | None: ...
    def reset(self) -> None: ...
    def close(self) -> None: ...

class CalibrationHandle:
    def __init__(self, path: str) -> None: ...
    def rig(self) -> tuple[float, float, float, float, float] | None: ...
    def size(self) -> tuple[int, int]: ...
    def rectify(
        self, left: npt.NDArray[Any], right: npt.NDArray[Any], bits: int | None
    ) -> list[npt.NDArray[np.uint8]]: ...
