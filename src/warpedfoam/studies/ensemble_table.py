"""The table of an ensemble: columns from runs and their outcomes, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.io import write_columns_csv
from warpedfoam.studies.observables import COUNTED, Value

Columns = dict[str, list[Value]]


def table_columns(rows: Iterable[Mapping[str, Value]], measured: Iterable[Mapping[str, Value]]) -> Columns:
    """Columns of equal length: those of the rows, then those measured, blank (None) where a row has none.

    Measured columns stand in the order in which they first occur, groups of counts (``charges.-1``)
    by number; counts are 0 where others of their group are known. A column that holds any float is one of
    floats.

    Examples
    --------
    >>> table_columns([{"run": 0}, {"run": 1}], [{"charges.1": 2}, {"charges.-1": 1, "e": 1.5}])
    {'run': [0, 1], 'charges.-1': [0, 1], 'charges.1': [2, 0], 'e': [None, 1.5]}
    """
    first, values = list(rows), list(measured)
    names = list(dict.fromkeys(name for row in first for name in row))
    out: Columns = {name: [row.get(name) for row in first] for name in names}
    places: dict[str, dict[str, None]] = {}
    for row in values:
        for name in row:
            group = name.rpartition(".")[0] if COUNTED.fullmatch(name) else name
            places.setdefault(group, {})[name] = None
    for group, members in places.items():
        counted = list(members) != [group]
        known = [counted and any(name in row for name in members) for row in values]
        order = sorted(members, key=lambda n: int(n.rpartition(".")[2])) if counted else [group]
        for name in order:
            out[name] = [row.get(name, 0 if k else None) for row, k in zip(values, known, strict=True)]
    return {name: _of_one_type(column) for name, column in out.items()}


def write_csv(path: Path, columns: Columns) -> Path:
    """Write the table as CSV, floats with all their digits."""
    return write_columns_csv(path, {name: _objects(values) for name, values in columns.items()})


def _of_one_type(values: list[Value]) -> list[Value]:
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) < 2:
        return values
    if kinds <= {bool, int, float}:
        kind: type = float if float in kinds else int
        return [None if value is None else kind(value) for value in values]
    return [None if value is None else str(value) for value in values]


def _objects(values: list[Value]) -> Any:
    out = np.empty(len(values), dtype=object)
    out[:] = values
    return out
