"""svl in Python: stereo matching into arrays of numpy, and the program svl.

    import svl_bench as svl

    rig = svl.Rig(focal_px=328, baseline_m=0.044, cx_px=160, cy_px=120)
    found = svl.match(left, right, "v5", rig=rig)          # of two images; NaN: unknown
    found.distance_m                                       # 3 x 5 cells, metres
    found.disparity, found.depth_m, found.points()         # of each pixel

    svl.evaluate(found.disparity, truth, rig=rig)          # how good an array is
    svl.write("own.mcap", zip(lefts, rights), rig=rig)     # a recording of arrays
    left, right = svl.calibration("stereo.yaml").rectify(left, right)

    with svl.Ranger("v5", rig=rig) as ranger:              # pairs of a camera, one after another
        for pair in svl.read("bag.mcap"):                  # everything that `svl score` reads
            cells = ranger.match(pair.left, pair.right, stamp_ns=pair.stamp_ns)

    print(svl.score("bag.mcap", ["v5", "sgm"]))            # svl.info("bag.mcap"), svl.algorithms()

match() and Ranger compute what the program does, to the bit. Other threads run meanwhile. Errors are
ValueError, TypeError, FileNotFoundError and other OSErrors, MemoryError and RuntimeError with svl's message.
Matchers in Python: svl_bench.matcher.

Names are loaded at their first use: a program that svl starts imports svl_bench.matcher alone.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import matcher
    from ._calibration import Calibration, calibration
    from ._evaluation import evaluate
    from ._pairs import Pair, read, write
    from ._program import algorithms, compare, info, program, record, report, score
    from ._ranger import REASONS, Match, Ranger, State, instruction_set, match
    from ._report import Report
    from ._rig import Rig

    __version__: str

_HOMES = {
    "_extension": ["__version__"],
    "_calibration": ["Calibration", "calibration"],
    "_evaluation": ["evaluate"],
    "_pairs": ["Pair", "read", "write"],
    "_program": ["algorithms", "compare", "info", "program", "record", "report", "score"],
    "_ranger": ["REASONS", "Match", "Ranger", "State", "instruction_set", "match"],
    "_report": ["Report"],
    "_rig": ["Rig"],
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "REASONS",
    "Calibration",
    "Match",
    "Pair",
    "Ranger",
    "Report",
    "Rig",
    "State",
    "__version__",
    "algorithms",
    "calibration",
    "compare",
    "evaluate",
    "info",
    "instruction_set",
    "match",
    "matcher",
    "program",
    "read",
    "record",
    "report",
    "score",
    "write",
]


def __getattr__(name: str) -> Any:
    if name == "matcher":
        return importlib.import_module(".matcher", __name__)
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        value = getattr(importlib.import_module(f".{_HOME_OF[name]}", __name__), name)
    except ModuleNotFoundError as error:
        if error.name != "numpy":
            raise
        raise ImportError(f"svl_bench.{name} needs numpy: pip install numpy") from error
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
