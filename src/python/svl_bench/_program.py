"""The program svl: what it scores, compares, records and knows."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import threading
from pathlib import Path
from typing import Any, Iterator, Mapping, Sequence

from ._report import Report
from ._types import Algorithm, Comparison, Info, PathLike

# svl's kinds of errors (svl_core::Error::kind).
_EXCEPTIONS = {"missing": FileNotFoundError, "io": OSError, "memory": MemoryError}


def program() -> str:
    """Path of the program svl: this environment's, which the wheel brings, or else that of PATH."""
    found = shutil.which("svl", path=sysconfig.get_path("scripts")) or shutil.which("svl")
    if found is None:
        raise FileNotFoundError(
            "the program svl is neither in this environment nor in PATH; install the wheel svl-bench"
        )
    return found


@contextlib.contextmanager
def running(
    *words: str, ok: Sequence[int] = (0,), folder: PathLike | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """A command of svl in a folder, whose standard output the caller reads. Its warnings and progress appear on
    sys.stderr as they come. Raises svl's error if it ends with a status that is not ok. Where the caller
    leaves early, svl is asked to end orderly, and waited for."""
    line = [program(), *words]
    errors: list[str] = []
    # The thread alone has the reading end, and at Python's end nothing waits for it.
    reading, writing = os.pipe()
    messages = threading.Thread(target=_pass_on, args=(reading, errors), daemon=True)
    messages.start()
    try:
        svl = subprocess.Popen(
            line,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=writing,
            cwd=folder,
            env={**os.environ, "SVL_ERROR_KINDS": "1"},
        )
    finally:
        os.close(writing)
    with svl:
        assert svl.stdout is not None
        try:
            yield svl
        except BaseException:
            # Ctrl-C reaches svl, too: what comes within 200 ms is the same interrupt to it.
            svl.terminate()
            svl.stdout.close()
            try:
                svl.wait(timeout=10)
            except subprocess.TimeoutExpired:
                svl.kill()
            raise
        svl.stdout.close()
        svl.wait()
        # A viewer that svl started may hold it open.
        messages.join(timeout=2)
    if svl.returncode not in ok:
        name = next(word for word in words if not word.startswith("-"))
        error = "".join(errors).strip() or f"svl {name} ended with the status {svl.returncode}"
        kind = _ERROR.match(error)
        # docs/exit-status.md: 2 is wrong usage.
        usual = ValueError if svl.returncode == 2 else RuntimeError
        raise _EXCEPTIONS.get(kind[1] if kind else "", usual)(error[kind.end() if kind else 0 :])


_ERROR = re.compile(r"error(?:\[(\w+)\])?: ")


def _pass_on(reading: int, errors: list[str]) -> None:
    """Passes warnings and progress on, and keeps the error, which is last."""
    with open(reading, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            if errors or _ERROR.match(line):
                errors.append(line)
            # A service may have none.
            elif sys.stderr is not None:
                sys.stderr.write(line)


def run(
    *words: str, ok: Sequence[int] = (0,), folder: PathLike | None = None
) -> tuple[int, str]:
    """The exit status and the output of a command of svl."""
    with running(*words, ok=ok, folder=folder) as svl:
        assert svl.stdout is not None
        output = svl.stdout.read()
    return svl.returncode, output.decode()


def words(options: Mapping[str, Any]) -> Iterator[str]:
    """Options of the command line: max_skew_ms=5, compress=True, stress=["noise", "blur"]."""
    for name, value in options.items():
        if name in ("help", "print_scenario"):
            raise ValueError(f"{name}: would do nothing else; call the program svl for it")
        name = "--" + name.replace("_", "-")
        if value is True:
            yield name
        elif value is not None and value is not False:
            values = value if isinstance(value, (list, tuple)) else [value]
            yield from (f"{name}={v}" for v in values)


def report(folder: PathLike) -> Report:
    """The report in a folder that `svl score` wrote. Raises FileNotFoundError, and ValueError for a folder
    that is none."""
    return Report(folder)


def score(
    source: PathLike | Sequence[PathLike],
    algorithms: str | Sequence[str] | Mapping[str, str] = "v5",
    *,
    output: PathLike | None = None,
    gate: bool = False,
    **options: Any,
) -> Report:
    """Scores algorithms on a scenario, recordings, bags or folders: `svl score`.

    algorithms: as on the command line, ["v5", "sgm:p1=20"], or by the names that the report gives them,
    {"mine": "exec:command=python3 mine.py"}. output: the report's folder, whose results are not matched
    again; None is a temporary one, which is removed with the Report. gate: the scenario's limits decide
    Report.gate_passed. options: those of the command line, with underscores: truth="/truth/depth",
    stress=["noise"], threads=4.

    Raises ValueError for wrong usage, FileNotFoundError, RuntimeError if it cannot be scored, with svl's
    message. Ctrl-C ends svl orderly.
    """
    sources = [source] if isinstance(source, (str, os.PathLike)) else source
    if isinstance(algorithms, Mapping):
        algorithms = [f"{name}={algorithm}" for name, algorithm in algorithms.items()]
    algo = [algorithms] if isinstance(algorithms, str) else list(algorithms)
    if not algo:
        raise ValueError("algorithms is empty: name at least one, as \"v5\"")
    temporary = None
    if output is None:
        temporary = tempfile.TemporaryDirectory(prefix="svl-")
        output = Path(temporary.name) / "report"
    given = {"rerun": "none", **options, "algo": algo, "output": output, "gate": gate}
    # 3: a limit of the gate is broken, and the report is complete.
    ok = (0, 3) if gate else (0,)
    paths = [os.fspath(path) for path in sources]
    status, _ = run("score", *words(given), "--json", "--", *paths, ok=ok)
    found = Report(output)
    found._temporary = temporary
    found.gate_passed = status == 0 if gate else None
    return found


def compare(
    base: PathLike | Report, other: PathLike | Report, *others: PathLike | Report, **options: Any
) -> list[Comparison]:
    """Changes between the first report and each other one, with confidence intervals: the JSON of
    `svl compare`. A report, its folder, or FOLDER#ALGORITHM. options: map=["v3=v5"]."""
    reports = (base, other, *others)
    names = [os.fspath(r.folder if isinstance(r, Report) else r) for r in reports]
    changes: list[Comparison] = json.loads(
        run("compare", *words(options), "--json", "--", *names)[1]
    )
    return changes


def record(source: PathLike, output: PathLike, **options: Any) -> Path:
    """Records pairs of a source, also of cameras, to the file `output`: `svl record`. Returns its path.

    options: those of the command line, with underscores: frames=60, seed=7, compress=True,
    calib="stereo.yaml", force=True.
    """
    if os.fspath(output) == "-":
        raise ValueError("record() writes to a file; read() returns the pairs themselves")
    run("record", *words({**options, "output": output}), "--", os.fspath(source))
    return Path(output)


def info(source: PathLike, **options: Any) -> Info:
    """What a recording, a bag or a folder has, and if svl can use it: the JSON of `svl info`.

    options: those of the command line, with underscores: left="/cam0/image_raw", truth="/depth".
    Raises FileNotFoundError, ValueError for wrong usage, RuntimeError.
    """
    found: Info = json.loads(run("info", *words(options), "--json", "--", os.fspath(source))[1])
    return found


def algorithms() -> list[Algorithm]:
    """All algorithms with their parameters: the JSON of `svl algos`."""
    found: list[Algorithm] = json.loads(run("algos", "--json")[1])
    return found
