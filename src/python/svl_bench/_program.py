"""The program svl: scores, reports, comparisons, recordings."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterator, Mapping, Sequence, Union

if TYPE_CHECKING:
    import pandas
    import svl_matcher

PathLike = Union[str, "os.PathLike[str]"]


def program() -> str:
    """Path of the program svl: this environment's, which the wheel brings, or else that of PATH."""
    found = shutil.which("svl", path=sysconfig.get_path("scripts")) or shutil.which("svl")
    if found is None:
        raise FileNotFoundError(
            "the program svl is neither in this environment nor in PATH; install the wheel svl-bench"
        )
    return found


def _run(*words: str, ok: Sequence[int] = (0,)) -> subprocess.CompletedProcess[str]:
    ran = subprocess.run(
        [program(), *words], stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8"
    )
    if ran.returncode not in ok:
        # docs/exit-status.md: 2 is wrong usage.
        lines = ran.stderr.strip() or f"svl {words[0]} ended with the status {ran.returncode}"
        raise (ValueError if ran.returncode == 2 else RuntimeError)(lines)
    # Warnings.
    sys.stderr.write(ran.stderr)
    return ran


def _words(options: Mapping[str, Any]) -> Iterator[str]:
    """Options of the command line: max_skew_ms=5, compress=True, stress=["noise", "blur"]."""
    for name, value in options.items():
        name = "--" + name.replace("_", "-")
        if value is True:
            yield name
        elif value is not None and value is not False:
            values = value if isinstance(value, (list, tuple)) else [value]
            yield from (f"{name}={v}" for v in values)


class Report:
    """A report in its folder. In a notebook it is the text of summary.md."""

    def __init__(self, folder: PathLike) -> None:
        self.folder = Path(folder)
        try:
            self.data: dict[str, Any] = json.loads(self._text("summary.json"))
        except FileNotFoundError:
            raise ValueError(
                f"{folder}: not one of svl's reports: it has no summary.json"
            ) from None
        self.gate_passed: bool | None = None
        """True or False if it was scored with gate=True."""

    def tables(self) -> dict[str, pandas.DataFrame]:
        """All tables by their names: rows, cells, summary and so on (`svl columns`)."""
        import svl_matcher

        return svl_matcher.report(self.folder)

    def __repr__(self) -> str:
        return f"svl_bench.report({os.fspath(self.folder)!r})"

    def __str__(self) -> str:
        return self._text("summary.md")

    def _repr_markdown_(self) -> str:
        return str(self)

    def _text(self, name: str) -> str:
        return (self.folder / name).read_text(encoding="utf-8")


def report(folder: PathLike) -> Report:
    """The report in a folder that `svl score` wrote. Raises ValueError for another folder."""
    return Report(folder)


def score(
    source: PathLike | Sequence[PathLike],
    algorithms: str | Sequence[str] = "v5",
    *,
    output: PathLike,
    gate: bool = False,
    **options: Any,
) -> Report:
    """Scores algorithms on a scenario, recordings, bags or folders: `svl score`.

    algorithms: as on the command line, ["v5", "sgm:p1=20"]. output: the report's folder; what it has
    already is not matched again. gate: the scenario's limits decide Report.gate_passed. options: those
    of the command line, with underscores: truth="/truth/depth", stress=["noise"], threads=4.

    Raises ValueError for wrong usage, RuntimeError if it cannot be scored, both with svl's message.
    """
    sources = [source] if isinstance(source, (str, os.PathLike)) else source
    algo = [algorithms] if isinstance(algorithms, str) else list(algorithms)
    given = {"rerun": "none", **options, "algo": algo, "output": output, "gate": gate}
    # 3: a limit of the gate is broken, and the report is complete.
    ok = (0, 3) if gate else (0,)
    ran = _run("score", *map(os.fspath, sources), *_words(given), "--json", ok=ok)
    found = Report(output)
    found.gate_passed = ran.returncode == 0 if gate else None
    return found


def compare(
    base: PathLike | Report, other: PathLike | Report, *others: PathLike | Report, **options: Any
) -> list[dict[str, Any]]:
    """Changes between the first report and each other one, with confidence intervals: the JSON of
    `svl compare`. A report, its folder, or FOLDER#ALGORITHM. options: map=["v3=v5"]."""
    reports = (base, other, *others)
    names = [os.fspath(r.folder if isinstance(r, Report) else r) for r in reports]
    return json.loads(_run("compare", *names, *_words(options), "--json").stdout)


def record(source: PathLike, output: PathLike, **options: Any) -> Path:
    """Records pairs of a source, also of cameras, to the file `output`: `svl record`. Returns its path.

    options: those of the command line, with underscores: frames=60, seed=7, compress=True,
    calib="stereo.yaml", force=True.
    """
    _run("record", os.fspath(source), *_words({**options, "output": output}))
    return Path(output)


def read(source: PathLike, **options: Any) -> Iterator[svl_matcher.Pair]:
    """The pairs of everything that `svl record` reads, as it records them: record() to a temporary
    file, then svl_matcher.read(). options: those of record()."""
    import svl_matcher

    with tempfile.TemporaryDirectory() as folder:
        yield from svl_matcher.read(record(source, Path(folder) / "pairs.mcap", **options))
