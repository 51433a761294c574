"""The extension module of this machine, or an error that says which machines have one."""

import platform
import sys
from importlib import metadata

try:
    from . import _svl as extension
except ImportError as error:

    def _wheel() -> str:
        """The platforms of the installed wheel, as its tags say them."""
        try:
            facts = metadata.distribution("svl-bench").read_text("WHEEL") or ""
        except metadata.PackageNotFoundError:
            return "no wheel is installed"
        tags = [line.split("-", 2)[2] for line in facts.splitlines() if line.startswith("Tag: ")]
        return f"the installed wheel is for {', '.join(tags) or 'none'}"

    raise ImportError(
        f"svl_bench has no extension for {sys.platform} on {platform.machine()}: {_wheel()}; there are "
        f"wheels for Linux with glibc 2.31 or later on x86_64 and aarch64 ({error})"
    ) from error

__all__ = ["__version__", "extension"]
__version__: str = extension.__version__
