"""Every table of a report, as pandas, polars, DuckDB and pyarrow read its CSV and its Parquet: tables.py REPORT.

All eight readings have the same values. Counts are signed, so that differences of them do not wrap; booleans are
booleans; hashes are texts. Tables can be filtered, joined and sorted by texts. Prints the number of tables and of
cells."""

import math
import pathlib
import sys

import duckdb
import pandas as pd
import polars as pl
import pyarrow.compute
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
    # Texts can be compared, joined and sorted.
    table = pyarrow.parquet.read_table(path)
    for name in [field.name for field in stored if "string" in str(field.type)]:
        texts = sorted(set(table[name].to_pylist()) - {None})
        for text in texts[:1]:
            count = table[name].to_pylist().count(text)
            assert table.filter(pyarrow.compute.equal(table[name], text)).num_rows == count, f"{path.name}, {name}"
            assert pyarrow.parquet.read_table(path, filters=[(name, "==", text)]).num_rows == count
            assert len(pd.read_parquet(path, filters=[(name, "==", text)])) == count
            one = pyarrow.table({name: pyarrow.array([text], table[name].type)})
            joined = table.select([name]).join(one, name, join_type="inner")
            assert joined.num_rows == count, f"{path.name}, {name}: {joined.num_rows} joined, {count} expected"
            frame = pd.read_parquet(path, dtype_backend="pyarrow")
            assert len(frame.merge(pd.DataFrame({name: [text]}), on=name)) == count
        assert table.sort_by(name)[name].to_pylist()[: len(texts)][:1] == texts[:1]
print(tables, cells)
