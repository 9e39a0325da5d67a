# SPDX-License-Identifier: BSD-3-Clause
"""Files with a list of pairs, ours or another library's: told from files of points, and read.

Whatever the format, a file is columns with names: i and j, and one for each component of the shift.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, missing_extra, one_line
from halfshell._cli.numpy_files import read_arrays
from halfshell._cli.text_files import open_text, shown_names

# Names of the two points, in lower case and without anything but letters and digits.
_WORDS = (
    ("source", "target"), ("src", "dst"), ("first", "second"), ("from", "to"),
    ("sender", "receiver"), ("senders", "receivers"), ("center", "neighbor"),
)  # fmt: skip
_STEMS = ("", "idx", "index", "indices", "atom", "atomindex", "atomid", "id", "node", "point",
          "particle", "p", "pair", "pairs", "edge", "edges", "edgeindex", "bonds",
          "neighborlist")  # fmt: skip
_ENDS = (("i", "j"), ("0", "1"), ("1", "2"))
_ENDPOINTS = (
    *_WORDS, *((stem + a, stem + b) for a, b in _ENDS for stem in _STEMS if stem or a == "i")
)  # fmt: skip
_SHIFTS = ("s", "shift", "shifts", "cellshift", "cellshifts", "unitshift", "unitshifts", "offset",
           "offsets", "edgeshift", "edgeshifts", "image")  # fmt: skip
_AXES = ("01234567", "xyz", "abc")
_OTHERS = ("cutoff", "inclusive", "n")  # what an archive of ours tells besides

_TEXT, _NUMPY = (".csv", ".txt", ".dat", ".tsv"), (".npy", ".npz")


@dataclass(frozen=True)
class PairList:
    """A list of pairs that is to be checked; what is None is not known."""

    author: str  # whose it is
    i: NDArray[np.int64]
    j: NDArray[np.int64]
    S: NDArray[np.int64] | None
    inclusive: bool | None = None  # the rule of its author: d <= cutoff, or d < cutoff
    full: bool | None = None  # whether it has both directions of every pair
    cutoff: float | None = None

    def among(self, rows: NDArray[np.intp] | None, n: int) -> PairList:
        """Return the pairs among some of n points, numbered by their place among these."""
        if rows is None:
            return self
        place = np.full(n, -1, dtype=np.int64)
        place[rows] = np.arange(len(rows))
        i, j = place[self.i], place[self.j]
        kept = (i >= 0) & (j >= 0)
        shifts = None if self.S is None else self.S[kept]
        return replace(self, i=i[kept], j=j[kept], S=shifts)


def refuse_list(file: str, source: str) -> None:
    """InputError that names `source` if a file has the columns of a list of pairs, not of points.

    A file that cannot be read is left to the reader of points, which says why.
    """
    suffix = Path(file).suffix.lower()
    if not os.path.isfile(file):
        return
    try:
        if suffix in _TEXT:
            with open_text(file, _has_endpoints) as text:
                names = text.names or []
        elif suffix == ".npz":
            names = read_arrays(file, ())[1]
        elif suffix == ".parquet":
            names = _parquet(file)[0]
        else:
            return
    except Exception:
        return
    if {"points", "x", "k"} & set(map(_plain, names)):  # coordinates beside i and j, or i, j and k
        return
    columns = names  # in an archive one name may stand for both columns
    if suffix == ".npz":
        columns = [*names, *(_plain(name) + end for name in names for end in "01")]
    if _has_endpoints(columns):
        raise InputError(
            f"{source}: is a list of pairs ({shown_names(names)}), not points; "
            "halfshell verify STRUCTURE LIST checks one"
        )


def read_list(file: str, n: int, ndim: int) -> PairList:
    """Read a list of pairs of `n` points with `ndim` coordinates.

    Text, ``.npz`` and ``.parquet`` have names of columns. Without names, those of text and of a
    ``.npy`` file are i, j, and perhaps the shift.
    """
    try:
        return _read(file, n, ndim)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    except MemoryError:
        raise
    except Exception as error:  # a broken file may fail in any part of its library
        raise InputError(f"{file}: cannot be read: {one_line(error)}") from None


def _read(file: str, n: int, ndim: int) -> PairList:
    suffix = Path(file).suffix.lower()
    others: dict[str, Any] = {}
    if suffix in _TEXT:
        names, columns = _read_text(file, ndim)
    elif suffix in _NUMPY:
        names, columns, others = _read_numpy(file, ndim)
    elif suffix == ".parquet":
        held, table_of = _parquet(file)
        names = _wanted(held, ndim)
        table = table_of(columns=names)
        columns = {name: table[name].to_numpy() for name in names}
    else:
        raise InputError(f"lists of pairs are read from {', '.join((*_TEXT, *_NUMPY, '.parquet'))}")
    whole = [_whole(name, columns[name]) for name in names]
    i, j = whole[:2]
    if len({len(column) for column in whole}) > 1:
        raise InputError("its columns differ in length")
    counts_from = _first_index(i, j, n)
    shift = np.column_stack(whole[2:]) if whole[2:] else None
    if others.get("n", n) != n:
        raise InputError(f"is a list for {others['n']} points; there are {n}")
    author = f"{file}, columns {', '.join(names)}"
    if counts_from:
        author += f", which counts points from {counts_from}"
    return PairList(
        author, i - counts_from, j - counts_from, shift, others.get("inclusive"),
        cutoff=others.get("cutoff"),
    )  # fmt: skip


# ---- which columns ---------------------------------------------------------------------------

def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _has_endpoints(names: Sequence[str]) -> bool:
    return _endpoints([_plain(name) for name in names]) is not None


def _endpoints(plain: Sequence[str]) -> tuple[int, int] | None:
    """Places of the names of both points, if they are there."""
    for first, second in _ENDPOINTS:
        if first in plain and second in plain:
            return plain.index(first), plain.index(second)
    return None


def _wanted(names: Sequence[str], ndim: int) -> list[str]:
    """The names of i, j and, as far as there are some, the components of the shift."""
    plain = [_plain(name) for name in names]

    def picked(places: Sequence[int]) -> list[str]:
        for k in places:
            if plain.count(plain[k]) > 1:
                raise InputError(f"has more than one column {names[k]}")
        return [names[k] for k in places]

    ends = _endpoints(plain)
    if ends is None:
        raise InputError(
            f"has no columns i and j, source and target, first and second, or the like "
            f"(it has {shown_names(names)})"
        )
    for stem in _SHIFTS:
        for axes in _AXES:
            found = [stem + axis for axis in axes if stem + axis in plain]
            if found:
                if len(found) != ndim:
                    held = ", ".join(names[plain.index(one)] for one in found)
                    raise InputError(
                        f"has shifts of {len(found)} axes ({held}); points have {ndim} coordinates"
                    )
                return picked([*ends, *map(plain.index, found)])
    return picked(ends)


def _unnamed(n_columns: int, ndim: int) -> list[str]:
    names = ["i", "j", *(f"S{axis}" for axis in range(ndim))]
    if n_columns not in (2, len(names)):
        raise InputError(
            f"has {n_columns} columns without names; those of a list are 2 (i, j) or "
            f"{len(names)} (with shifts): name them in the first line"
        )
    return names[:n_columns]


# ---- formats ---------------------------------------------------------------------------------

def _read_text(file: str, ndim: int) -> tuple[list[str], dict[str, NDArray[Any]]]:
    with open_text(file, _has_endpoints) as text:
        if text.names is None:
            found = _unnamed(text.width, ndim)
            places = list(range(len(found)))
        else:
            found = _wanted(text.names, ndim)
            places = [text.names.index(name) for name in found]
        return found, dict(zip(found, text.read(places).T, strict=True))


def _read_numpy(
    file: str, ndim: int
) -> tuple[list[str], dict[str, NDArray[Any]], dict[str, Any]]:
    names = read_arrays(file, ())[1]
    known = {"alone", *chain(*_ENDPOINTS), *_STEMS, *_SHIFTS}
    known |= {stem + axis for stem in _SHIFTS for axis in chain(*_AXES)}
    arrays, _ = read_arrays(file, [one for one in names if _plain(one) in known or one in _OTHERS])
    others = {name: array.item() for name, array in arrays.items()
              if name in _OTHERS and array.size == 1}  # fmt: skip
    columns: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        if array.ndim == 1:
            columns[name] = array
        elif array.ndim == 2:  # (m, 2), (m, d), or the edges of a graph (2, m)
            is_across = array.shape[0] == 2 < array.shape[1] and _plain(name) not in _SHIFTS
            rows = array if is_across else array.T
            columns |= {f"{name}{k}": column for k, column in enumerate(rows)}
    if names == ["alone"]:
        found = _unnamed(len(columns), ndim)
        return found, dict(zip(found, columns.values(), strict=True)), others
    if not _has_endpoints(list(columns)):
        _wanted(names, ndim)  # which says what the file holds
    return _wanted(list(columns), ndim), columns, others


def _parquet(file: str) -> tuple[list[str], Any]:
    """Names of the columns, and a function that reads some of them as a table."""
    library: Any
    if find_spec("pyarrow") is not None:
        library = import_module("pyarrow.parquet")
        return list(library.read_schema(file).names), partial(library.read_table, file)
    if find_spec("polars") is not None:
        library = import_module("polars")
        return list(library.read_parquet_schema(file)), partial(library.read_parquet, file)
    raise missing_extra("reading Parquet", "pyarrow")


# ---- values ----------------------------------------------------------------------------------

def _whole(name: str, column: NDArray[Any]) -> NDArray[np.int64]:
    """A column as integers; InputError if there is one that is none."""
    if column.dtype.kind not in "iuf":
        raise InputError(f"column {name} has type {column.dtype}, not whole numbers")
    with np.errstate(invalid="ignore"):
        whole = column.astype(np.int64)
        wrong = np.flatnonzero(whole != column)
    if len(wrong):
        row = int(wrong[0])
        value = column[row].item()
        what = "not a whole number" if value % 1 else "too large for an int64"
        raise InputError(f"{name} of row {row} is {value}, {what}")
    return whole


def _first_index(i: NDArray[np.int64], j: NDArray[np.int64], n: int) -> int:
    """0, or 1 where the points must be counted from 1, because some index is `n` and none is 0."""
    if not len(i):
        return 0
    least, most = int(min(i.min(), j.min())), int(max(i.max(), j.max()))
    if least >= 0 and most < n:
        return 0
    if least >= 1 and most == n:
        return 1
    raise InputError(f"has points {least} to {most}; there are {n}, 0 to {n - 1}")
