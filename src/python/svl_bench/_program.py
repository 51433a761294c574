"""The program svl, its reports and comparisons."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path
from typing import Any, Iterator, Mapping, Sequence, Union

PathLike = Union[str, "os.PathLike[str]"]


def program() -> str:
    """Path of the program svl: that of SVL_PROGRAM, of this environment (the wheel's), or of PATH.

    Raises FileNotFoundError if there is none.
    """
    named = os.environ.get("SVL_PROGRAM")
    found = named or shutil.which("svl", path=sysconfig.get_path("scripts")) or shutil.which("svl")
    if found is None:
        raise FileNotFoundError(
            "the program svl is neither in this environment nor in PATH; the wheel svl-bench has it, "
            "and SVL_PROGRAM names another"
        )
    return found


def _run(*words: str, ok: Sequence[int] = (0,)) -> subprocess.CompletedProcess[str]:
    ran = subprocess.run(
        [program(), *words], stdin=subprocess.DEVNULL, capture_output=True, text=True, encoding="utf-8"
    )
    if ran.returncode not in ok:
        lines = ran.stderr.strip() or f"svl ended with the status {ran.returncode}"
        # Wrong usage is the caller's mistake (docs/exit-status.md).
        raise (ValueError if ran.returncode == 2 else RuntimeError)(lines)
    return ran


def _words(options: Mapping[str, Any]) -> Iterator[str]:
    """Options of the command line: max_skew_ms=5, compress=True, stress=["noise", "blur"]."""
    for name, value in options.items():
        name = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            yield name
            continue
        values = value if isinstance(value, (list, tuple)) else [value]
        yield from (f"{name}={os.fspath(v) if isinstance(v, os.PathLike) else v}" for v in values)


def _table(path: Path) -> Any:
    try:
        import polars

        return polars.read_parquet(path)
    except ModuleNotFoundError:
        pass
    try:
        from pyarrow import parquet

        return parquet.read_table(path)
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            "tables need polars or pyarrow: pip install polars, or pip install pyarrow"
        ) from None


class Report(Mapping[str, Any]):
    """A report's tables by their names, as frames of polars or else tables of pyarrow: summary (per
    algorithm), rows (per pair), cells, checkpoints, verdicts, ... Units of columns: `svl columns`.

    In a notebook it shows the table of its page, and the plot.
    """

    def __init__(self, folder: PathLike, gate_passed: bool | None = None) -> None:
        self.folder = Path(folder)
        if not (self.folder / "manifest.json").is_file():
            raise ValueError(f"{folder}: not one of svl's reports: it has no manifest.json")
        self.gate_passed = gate_passed
        """True or False of a run with gate=True."""

    @property
    def manifest(self) -> dict[str, Any]:
        """What was run: algorithms, inputs, versions, hashes."""
        return json.loads((self.folder / "manifest.json").read_text(encoding="utf-8"))

    @property
    def page(self) -> Path:
        """The page to read."""
        return self.folder / "index.html"

    def __getitem__(self, name: str) -> Any:
        path = self.folder / f"{name}.parquet"
        if not path.is_file():
            raise KeyError(f"no table {name!r} in {self.folder}; there are {', '.join(self)}")
        return _table(path)

    def __iter__(self) -> Iterator[str]:
        return (path.stem for path in sorted(self.folder.glob("*.parquet")))

    def __len__(self) -> int:
        return len(list(self.folder.glob("*.parquet")))

    def __repr__(self) -> str:
        return f"svl_bench.Report({str(self.folder)!r})"

    def __str__(self) -> str:
        return (self.folder / "summary.md").read_text(encoding="utf-8")

    def _repr_html_(self) -> str:
        page = self.page.read_text(encoding="utf-8")
        plot = re.search(r'<section id="plot".*?(<svg.*?</svg>)', page, re.DOTALL)
        shown = f'<div style="max-width: 40em">{plot[1]}</div>' if plot else ""
        return _html_table(str(self)) + shown


def _html_table(markdown: str) -> str:
    """The first table of a text in Markdown."""
    lines = [line for line in markdown.partition("\n|")[2].split("\n\n")[0].splitlines()]
    rows = []
    for line in lines:
        if re.fullmatch(r"[|:\- ]+", line):
            continue
        cells = re.split(r"(?<!\\)\|", line.strip().strip("|"))
        rows.append([html.escape(re.sub(r"\\(.)", r"\1", cell.strip())) for cell in cells])
    tags = ["th"] + ["td"] * len(rows)
    body = "".join(
        "<tr>" + "".join(f"<{tag}>{cell}</{tag}>" for cell in row) + "</tr>"
        for tag, row in zip(tags, rows)
    )
    return f"<table>{body}</table>"


def report(folder: PathLike) -> Report:
    """The report in a folder that `svl score` wrote. Raises ValueError for another folder."""
    return Report(folder)


def score(
    source: PathLike | Sequence[PathLike],
    algorithms: str | Sequence[str] = (),
    *,
    output: PathLike | None = None,
    gate: bool = False,
    **options: Any,
) -> Report:
    """Scores algorithms on a scenario, recordings, bags or folders: `svl score`.

    algorithms: as on the command line, ["v5", "sgm:p1=20"] (default: the scenario's, or v5). output: the
    report's folder; what it has already is not matched again (default: reports/SCENARIO). gate: limits of
    the scenario decide Report.gate_passed. options: those of the command line, with underscores:
    truth="/truth/depth", stress=["noise"], threads=4.

    Raises ValueError for a wrong request, RuntimeError with svl's message if it cannot be scored.
    """
    sources = [source] if isinstance(source, (str, os.PathLike)) else source
    names = [algorithms] if isinstance(algorithms, str) else algorithms
    given = {"algo": list(names), "output": output, "gate": gate, **options}
    # 3: a limit of the gate. The report is complete.
    ran = _run(
        "score", *map(os.fspath, sources), *_words(given), "--rerun=none", ok=(0, 3) if gate else (0,)
    )
    found = re.search(r"^report +(.+)/index\.html$", ran.stdout, re.MULTILINE)
    folder = output if output is not None else found and found[1]
    if folder is None:
        raise RuntimeError(f"svl named no report:\n{ran.stdout}")
    return Report(folder, ran.returncode == 0 if gate else None)


class Comparison:
    """Changes of metrics between two reports: `data` is the JSON of `svl compare`. Shown as Markdown, and
    in a notebook as its table."""

    def __init__(self, data: list[Any], markdown: str) -> None:
        self.data = data
        self.markdown = markdown

    def __str__(self) -> str:
        return self.markdown

    def __repr__(self) -> str:
        return self.markdown

    def _repr_markdown_(self) -> str:
        return self.markdown


def compare(
    base: PathLike | Report, other: PathLike | Report, *others: PathLike | Report, **options: Any
) -> Comparison:
    """Compares reports with the first one, with confidence intervals: `svl compare`. A name may be a
    folder, FOLDER#ALGORITHM, or a Report. options: map=["v3=v5"], columns="all"."""
    reports = (base, other, *others)
    names = [os.fspath(r.folder if isinstance(r, Report) else r) for r in reports]
    words = [*names, *_words(options)]
    data = json.loads(_run("compare", *words, "--json").stdout)
    return Comparison(data, _run("compare", *words, "--markdown").stdout)


def record(source: PathLike, output: PathLike, **options: Any) -> Path:
    """Records pairs of a source, also of cameras, to the file `output`: `svl record`. Returns its path.

    options: those of the command line, with underscores: frames=60, seed=7, ros2=True, compress=True,
    calib="stereo.yaml", force=True.
    """
    _run("record", os.fspath(source), *_words({"output": output, **options}))
    return Path(output)
