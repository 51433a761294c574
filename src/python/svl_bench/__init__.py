"""svl in Python: stereo matching into arrays of numpy, and the program svl.

    import svl_bench as svl

    rig = svl.Rig(focal_px=328, baseline_m=0.044, cx_px=160, cy_px=120)
    found = svl.match(left, right, "v5", rig=rig)          # of two arrays, uint8
    found.distance_m                                       # 3 x 5 cells, metres; NaN: unknown
    found.disparity                                        # per pixel; infinite: none

    with svl.Ranger("v5", rig=rig) as ranger:              # pairs of a camera, one after another
        for pair in svl.read("bag.mcap"):                  # everything that `svl record` reads
            cells = ranger.match(pair.left, pair.right, stamp_ns=pair.stamp_ns)

    print(svl.score("bag.mcap", ["v5", "sgm"], output="report"))

match() and Ranger compute what the program does, to the bit. Other threads run meanwhile. Errors are
ValueError, TypeError, OSError and RuntimeError with svl's message. Matchers in Python: svl_matcher.
"""

from __future__ import annotations

from ._extension import extension
from ._program import Report, compare, program, read, record, report, score
from ._ranger import REASONS, Match, Ranger, Rig, State, instruction_set, match

__version__: str = extension.__version__

__all__ = [
    "REASONS",
    "Match",
    "Ranger",
    "Report",
    "Rig",
    "State",
    "__version__",
    "compare",
    "instruction_set",
    "match",
    "program",
    "read",
    "record",
    "report",
    "score",
]
