"""The extension module of this machine, or an error that says which are there."""

import platform
import sys
from pathlib import Path

try:
    from . import _svl as extension
except ImportError as error:
    there = sorted(path.name for path in Path(__file__).parent.glob("_svl.*") if path.suffix != ".pyi")
    raise ImportError(
        f"svl_bench has no extension for {sys.platform} on {platform.machine()}: there is "
        f"{', '.join(there) or 'none'} ({error}); install the wheel of this machine"
    ) from error
