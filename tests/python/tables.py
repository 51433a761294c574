"""Every table of a report, as pandas, polars, DuckDB and pyarrow read its CSV and its Parquet: tables.py REPORT.

All eight readings have the same values. Counts are signed, so that differences of them do not wrap; booleans are
booleans; hashes are texts. Prints the number of tables, columns and rows."""

import math
import pathlib
import sys

import duckdb
import pandas as pd
import polars as pl
import pyarrow.csv
import pyarrow.parquet

READERS = {
    "pandas": (pd.read_csv, pd.read_parquet),
    "polars": (lambda path: pl.read_csv(path, infer_schema_length=None), pl.read_parquet),
    "duckdb": (
        lambda path: duckdb.read_csv(str(path), header=True, sample_size=-1).to_arrow_table(),
        lambda path: duckdb.read_parquet(str(path)).to_arrow_table(),
    ),
    "pyarrow": (pyarrow.csv.read_csv, pyarrow.parquet.read_table),
}


def columns(table):
    """Lists of plain values by the names of the columns."""
    if isinstance(table, pd.DataFrame):
        return {name: table[name].tolist() for name in table}
    if isinstance(table, pl.DataFrame):
        return table.to_dict(as_series=False)
    return table.to_pydict()


def plain(value):
    """None for what is absent: an empty text and no number, in a table of text."""
    is_absent = value is None or value == "" or value is pd.NA or (isinstance(value, float) and math.isnan(value))
    return None if is_absent else value


tables = cells = 0
for path in sorted(pathlib.Path(sys.argv[1]).glob("*.parquet")):
    stored = pyarrow.parquet.read_schema(path)
    for field in stored:
        kind = str(field.type)
        assert not kind.startswith("uint"), f"{path.name}, {field.name}: {kind}"
        if field.name == "session" or field.name.endswith("hash"):
            assert "string" in kind, f"{path.name}, {field.name}: {kind}"
    expected = columns(pyarrow.parquet.read_table(path))
    for library, (read_csv, read_parquet) in READERS.items():
        for table, form in (read_csv(path.with_suffix(".csv")), "CSV"), (read_parquet(path), "Parquet"):
            found = columns(table)
            assert list(found) == list(expected), f"{path.name}, {library}, {form}: {list(found)}"
            for name, values in expected.items():
                for row, (a, b) in enumerate(zip(map(plain, values), map(plain, found[name]), strict=True)):
                    # Texts of digits, as the name of a scene, are numbers in a CSV.
                    a, b = (str(a), str(b)) if isinstance(a, str) and b is not None else (a, b)
                    assert a == b, f"{path.name}, {library}, {form}, {name}, row {row}: {a!r}, {b!r}"
                    assert not isinstance(a, bool) or isinstance(b, bool), f"{path.name}, {library}, {name}: {b!r}"
                    cells += 1
    tables += 1
print(tables, cells)
