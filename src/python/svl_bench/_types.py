"""Types that several modules use."""

import os
from typing import Union

PathLike = Union[str, "os.PathLike[str]"]
