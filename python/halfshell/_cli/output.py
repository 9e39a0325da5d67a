# SPDX-License-Identifier: BSD-3-Clause
"""Columns of the command line as a file: CSV, a NumPy archive, or CSV on standard output."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.files import InputError, replacing

__all__ = ["check_size", "open_output", "write_columns", "write_csv"]

# About how many characters a number has in text, with what separates it from the next.
_DIGITS_OF_FLOAT, _DIGITS_OF_SHIFT = 19, 3


def open_output(
    target: str | None,
    source: str | None,
    stack: ExitStack,
    suffixes: tuple[str, ...] = (".npz", ".csv"),
    json: bool = False,
) -> IO[bytes] | None:
    """Open what will replace `target`, before the search; ``-`` is standard output."""
    if target is None:
        return None
    if target == "-" and ".csv" in suffixes:
        if json:
            raise InputError("-o - and --json would both print: give -o the name of a file")
        sys.stdout.flush()
        return sys.stdout.buffer
    if not target.lower().endswith(suffixes):
        raise InputError(f"{target}: the name must end in {' or '.join(suffixes)}")
    if source is not None and os.path.exists(target) and os.path.samefile(target, source):
        raise InputError(f"{target}: is the input; it is not overwritten")
    return stack.enter_context(replacing(target))


def check_size(
    target: str, letters: str, n_pairs: int, n_points: int, ndim: int, most: float
) -> None:
    """InputError for an output that would be larger than `most` bytes, told beforehand."""
    in_text = not target.lower().endswith(".npz")
    number = (len(str(n_points)) + 1, _DIGITS_OF_FLOAT, _DIGITS_OF_SHIFT) if in_text else (8, 8, 4)
    of_each = {
        "i": number[0], "j": number[0], "P": 2 * number[0], "d": number[1],
        "D": ndim * number[1], "S": ndim * number[2],
    }  # fmt: skip
    size = n_pairs * sum(of_each[letter] for letter in letters)
    if size > most:
        raise InputError(
            f"{target}: would have {n_pairs:,} pairs in about {_readable(size)}, more than "
            f"--max-output {_readable(most)}: raise it, or choose fewer --quantities"
        )


def _readable(size: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} TB"


def write_columns(
    stream: IO[bytes], target: str, columns: dict[str, NDArray[Any]], **extra: Any
) -> None:
    """Write them as the name says; `extra` goes into archives alone."""
    if target.lower().endswith(".npz"):
        np.savez(stream, **columns, **extra)  # type: ignore[arg-type]
    else:
        write_csv(stream, columns)
    stream.flush()


def write_csv(stream: IO[bytes], columns: dict[str, NDArray[Any]]) -> None:
    """Write one line an entry; vectors take a column for each component: ``S0,S1,S2``.

    Floats are written with the fewest digits that read back as the same number.
    """
    names: list[str] = []
    series: list[NDArray[Any]] = []
    for letter, column in columns.items():
        if column.ndim == 1:
            names.append(letter)
            series.append(column)
        else:
            names += [f"{letter}{k}" for k in range(column.shape[1])]
            series += list(column.T)
    stream.write((",".join(names) + "\n").encode())
    line = ",".join("%s" if values.dtype.kind == "U" else "%r" for values in series)
    block = 1 << 16  # lines turned into text at a time: some megabytes
    for start in range(0, len(series[0]), block):
        parts = [values[start : start + block].tolist() for values in series]
        rows = zip(*parts, strict=True)
        stream.writelines((line % row + "\n").encode() for row in rows)
