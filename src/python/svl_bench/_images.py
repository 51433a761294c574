"""Arrays of a caller as images: whatever numpy makes an array of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt


def image(array: Any, side: str, scale: float | None = None) -> npt.NDArray[Any]:
    """uint8 or uint16, height x width [x 3 or 4], of an array, a list, an image of PIL. It is copied only
    where its type, byte order or strides do not fit: rows may have gaps, pixels may not."""
    found: npt.NDArray[Any] = np.asarray(array)
    if found.dtype.kind not in "uif":
        given = f"an array of {found.dtype}" if isinstance(array, np.ndarray) else type(array).__name__
        raise TypeError(f"{side}: expected an image of integers, or of floats with scale=, got {given}")
    if found.size == 0:
        raise ValueError(f"{side}: an array of shape {found.shape} has no pixels")
    if found.ndim == 3 and found.shape[2] == 1:
        found = found[..., 0]
    if (found.dtype.kind == "f") != (scale is not None):
        cure = "scale= is the factor to 0..255 of floats, 255 of those from 0 to 1"
        raise TypeError(f"{side}: an image of {found.dtype}: {cure}")
    if scale is not None:
        if not np.isfinite(found).all():
            raise ValueError(f"{side}: has pixels that are not finite")
        found = np.clip(np.rint(found * scale), 0, 255).astype(np.uint8)
    elif found.dtype.kind == "u" and found.itemsize == 2:
        found = found.astype(np.uint16, copy=False)
    elif found.dtype != np.uint8:
        least, greatest = found.min(), found.max()
        if least < 0 or greatest > 255:
            cure = "expected 0 to 255, or an array of uint16 with bits="
            raise ValueError(f"{side}: has values from {least} to {greatest}: {cure}")
        found = found.astype(np.uint8)
    is_packed = found.ndim > 1 and found[0].flags.c_contiguous and found.strides[0] >= found[0].nbytes
    return found if is_packed else np.ascontiguousarray(found)
