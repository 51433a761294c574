"""A report of `svl score`: its numbers, its tables as frames, its page in a notebook."""

from __future__ import annotations

import html
import importlib.util
import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable

if TYPE_CHECKING:
    from ._types import PathLike


class Report:
    """A report in its folder. A notebook shows the table and the plots of its page, print() the text of
    summary.md."""

    def __init__(self, folder: PathLike) -> None:
        self.folder = Path(folder)
        self._temporary: object = None
        if not self.folder.exists():
            raise FileNotFoundError(f"{folder}: no such folder")
        try:
            self.data: dict[str, Any] = json.loads(self._text("summary.json"))
        except (FileNotFoundError, NotADirectoryError):
            raise ValueError(
                f"{folder}: not one of svl's reports: it has no summary.json"
            ) from None
        self.gate_passed: bool | None = None
        """True or False if it was scored with gate=True."""

    def tables(self, frames: str | None = None) -> dict[str, Any]:
        """All tables by their names, rows, cells, summary and so on: docs/tables.md explains the columns.

        frames: "polars", "pyarrow" or "pandas" for its data frames; None is the first of them that is
        installed. Raises ImportError if none is, or the named one is not, FileNotFoundError if the folder is
        gone.
        """
        read = _reader(frames)
        if not self.folder.exists():
            raise FileNotFoundError(f"{self.folder}: no such folder")
        return {path.stem: read(path.with_suffix("")) for path in sorted(self.folder.glob("*.csv"))}

    def __repr__(self) -> str:
        return f"svl_bench.report({os.fspath(self.folder)!r})"

    def __str__(self) -> str:
        return self._text("summary.md")

    def _repr_markdown_(self) -> str:
        return str(self)

    def _repr_html_(self) -> str | None:
        """The beginning of the page, in a frame of its own, as its style and script are a page's."""
        try:
            page = self._text("index.html")
        except FileNotFoundError:
            return None
        # Frames, their images, details and links to them stay in the file.
        page = re.split('<section id="(?:frames|details)"', page, maxsplit=1)[0]
        page = re.sub("<image id=[^>]*/>\n?", "", page)
        page = re.sub(r'(<a\b[^>]*?) href="#[^"]*"', r"\1", page)
        fit = "this.style.height = this.contentDocument.documentElement.scrollHeight + 'px'"
        return (
            f'<iframe srcdoc="{html.escape(page + "</main></body></html>")}" onload="{fit}" '
            'style="width: 100%; height: 40em; border: 0"></iframe>'
        )

    def _text(self, name: str) -> str:
        return (self.folder / name).read_text(encoding="utf-8")


def _polars(stem: Path) -> Any:
    return importlib.import_module("polars").read_parquet(stem.with_suffix(".parquet"))


def _pyarrow(stem: Path) -> Any:
    return importlib.import_module("pyarrow.parquet").read_table(stem.with_suffix(".parquet"))


def _pandas(stem: Path) -> Any:
    # Parquet needs another library besides.
    return importlib.import_module("pandas").read_csv(stem.with_suffix(".csv"))


_READERS: dict[str, Callable[[Path], Any]] = {
    "polars": _polars,
    "pyarrow": _pyarrow,
    "pandas": _pandas,
}
"""The libraries of frames, the preferred first."""


def _reader(name: str | None) -> Callable[[Path], Any]:
    names = list(_READERS) if name is None else [name]
    if names[0] not in _READERS:
        raise ValueError(f"frames={name!r}: expected one of {', '.join(_READERS)}")
    there = [name for name in names if importlib.util.find_spec(name)]
    if not there:
        raise ImportError(f"tables() needs {' or '.join(names)}: pip install {names[0]}")
    return _READERS[there[0]]
