# SPDX-License-Identifier: BSD-3-Clause
"""Points in text: one a line, coordinates apart by spaces, tabs, commas or semicolons."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["BadLine", "read_points"]


class BadLine(Exception):
    """What is wrong with a line, which is named."""


def read_points(file: str) -> NDArray[np.float64]:
    """Read the points of a text file.

    Empty lines, and what is behind ``#``, are left out. A first line that holds no number is one of
    names. All others have as many numbers.

    Raises
    ------
    BadLine
        With the number of the line, from 1 on.
    OSError, UnicodeDecodeError
        If the file cannot be read as text.
    """
    rows: list[list[float]] = []
    is_first = True
    with open(file, encoding="utf-8-sig") as lines:
        for number, line in enumerate(lines, 1):
            words = line.partition("#")[0].replace(",", " ").replace(";", " ").split()
            if not words:
                continue
            values = _numbers(words)
            names_columns = is_first and all(value is None for value in values)
            is_first = False
            if names_columns:
                continue
            row = [value for value in values if value is not None]
            if len(row) < len(values):
                word = words[values.index(None)]
                raise BadLine(f"line {number}: {word!r} is not a number")
            for value in row:
                if not math.isfinite(value):
                    raise BadLine(f"line {number}: {value} is not a finite number")
            if rows and len(row) != len(rows[0]):
                raise BadLine(f"line {number}: has {len(row)} numbers, lines before {len(rows[0])}")
            rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(rows[0]) if rows else 3)


def _numbers(words: list[str]) -> list[float | None]:
    found: list[float | None] = []
    for word in words:
        try:
            found.append(float(word))
        except ValueError:
            found.append(None)
    return found
