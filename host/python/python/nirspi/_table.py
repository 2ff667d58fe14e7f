"""Tables in memory: their columns of numbers, and the same as a file."""

from __future__ import annotations

import os
import zipfile
from typing import Any

import numpy as np

from . import _arrays
from ._nirspi import Error

# Types of pandas that have a value for "missing".
_NULLABLE = frozenset(
    ["Float32", "Float64", *(f"{kind}{bits}" for kind in ("Int", "UInt") for bits in (8, 16, 32, 64))]
)


def columns_of(table: Any) -> dict[str, np.ndarray]:
    """The columns of numbers of a table."""
    names = getattr(getattr(table, "dtype", None), "names", None)
    if names is None:
        names = getattr(table, "columns", None)
    if names is None and hasattr(table, "keys"):
        names = table.keys()
    if names is None:
        raise Error(f"table is {type(table).__name__}, expected columns by their names")
    found: dict[str, np.ndarray] = {}
    for name in names:
        column = table[name]
        if hasattr(column, "to_numpy") and str(getattr(column, "dtype", "")) in _NULLABLE:
            column = column.to_numpy(dtype=np.float64, na_value=np.nan)
        values = _arrays.array_of(column, f"column {name!r}")
        if values.dtype.kind == "O":
            try:
                values = values.astype(np.float64)
            except (TypeError, ValueError):
                continue
        if values.dtype.kind in "biufc":
            found[str(name)] = values
    return found


def write(columns: dict[str, np.ndarray], folder: str) -> str:
    """Writes the columns as an ``.npz`` into the folder; returns its path."""
    path = os.path.join(folder, "table.npz")
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in columns.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(values), allow_pickle=False)
    return path
