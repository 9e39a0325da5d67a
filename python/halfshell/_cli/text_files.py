# SPDX-License-Identifier: BSD-3-Clause
"""Points in text: one a line, fields apart by semicolons, tabs, commas or spaces.

Coordinates are the columns that `--columns` names, or those that names of a header tell (``x y z``,
``pos_x``, ``x [nm]``, ``Points:0`` ...), or all of up to three columns without names. Anything else
is refused with the line and the field: an index, a mass or a list of pairs is no coordinate.
"""

from __future__ import annotations

import io
import math
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?", re.ASCII)
_MOST_UNNAMED = 3
_MOST_AXES = 8
MOST_SHOWN = 12  # names of columns in a message
_PTS = {n: "x y z intensity r g b".split()[:n] for n in (3, 4, 7)} | {6: "x y z r g b".split()}

# What may stand beside the letter or the number of an axis.
_STEMS = frozenset(
    "|pos|position|positions|coord|coords|coordinate|coordinates|point|points|cart|cartn|loc|"
    "location|center|centre|centroid|com|atom".split("|")
)
_UNIT = re.compile(r"\s*([\[(].*[\])]|/\s*\w+|_(a|ang|angstrom|nm|um|mm|cm|m|km|pc|kpc|mpc))$")
_AXES = (
    (re.compile(r"(?P<stem>.*?)[\s_.:-]*(?P<axis>[xyz])"), "xyz"),
    (re.compile(r"(?P<axis>[xyz])[\s_.:-]*(?P<stem>.*)"), "xyz"),
    (re.compile(r"(?P<stem>.*?)[\s_.:-]*(?P<axis>[0-9])"), "0123456789"),
)
_NUMBERED_POINT = re.compile(r"[yz][\s_.:-]*\d+")


# Suffixes of packed files, what these begin with, and what unpacks them.
_PACKED = {
    ".gz": (b"\x1f\x8b", "gzip"), ".bz2": (b"BZh", "bz2"), ".xz": (b"\xfd7zXZ\0", "lzma")
}  # fmt: skip


def open_bytes(file: str) -> IO[bytes]:
    """Open a file for reading, unpacked if its first bytes say that it is packed."""
    with open(file, "rb") as stream:
        start = stream.read(6)
    for magic, module in _PACKED.values():
        if start.startswith(magic):
            unpacked: IO[bytes] = import_module(module).open(file, "rb")
            return unpacked
    return open(file, "rb")


def kind_of_file(file: str) -> str:
    """The last suffix of a name without that of a compression, in small letters: ``.pdb``."""
    path = Path(file)
    return (path.with_suffix("") if path.suffix.lower() in _PACKED else path).suffix.lower()


def read_points(
    file: str, columns: Sequence[str] = (), is_pts: bool = False, least: int = 1
) -> tuple[NDArray[np.float64], str]:
    """Read the points of a text file, and say of which columns.

    Empty lines, and what is behind ``#``, are left out. A first line that holds no number is one of
    names; so is a remark right before the first point whose words name its columns. A first line
    that holds one whole number, where others hold more, says how many points there are.

    columns: names, or numbers from 1 on, of those that are coordinates; default: told from the
    names. is_pts: columns without names are those of a PTS file: x y z, intensity, colours. least:
    of coordinates, in a file that its name does not tell to be text.
    """
    with open_bytes(file) as stream:
        lines = io.TextIOWrapper(stream, encoding="utf-8-sig")
        try:
            points, what = _read(_Lines(lines), columns, is_pts)
        except UnicodeDecodeError:
            raise InputError("is not text") from None
    if points.shape[1] < least:
        raise InputError(f"has {points.shape[1]} column of numbers")
    return points, what


class _Lines:
    """Lines that hold something, numbered, and the last remark before the first of them."""

    def __init__(self, stream: Iterable[str]) -> None:
        self._all = enumerate(stream, 1)
        self.remark = ""
        self._again: list[tuple[int, str]] = []

    def __iter__(self) -> Iterator[tuple[int, str]]:
        while self._again:
            yield self._again.pop()
        for number, line in self._all:
            text, _, remark = line.partition("#")
            if text.strip():
                yield number, text.strip(" \r\n")
            else:
                self.remark = remark.strip() or self.remark

    def give_back(self, *lines: tuple[int, str]) -> None:
        self._again += reversed(lines)


def _read(
    lines: _Lines, columns: Sequence[str], is_pts: bool
) -> tuple[NDArray[np.float64], str]:
    some = iter(lines)
    head = [line for line in (next(some, None), next(some, None)) if line is not None]
    if not head:
        return np.empty((0, 3)), "no line"
    number, text = head.pop(0)
    promised, counted = None, number
    if head and text.isdecimal() and len(_split(head[0][1], _separator(head[0]))) > 1:
        promised, (number, text) = int(text), head.pop(0)  # how many there are
    separator = _separator((number, text))
    first = _split(text, separator)
    names = _names_of(first)
    if names is None:
        head.insert(0, (number, text))
        told = _split(lines.remark, separator)
        if len(told) == len(first) and _groups(told):
            names = told
        elif is_pts:
            names = _PTS.get(len(first))
    lines.give_back(*head)
    picked = _choose(names, len(first), columns, number, separator)
    if len(picked) > _MOST_AXES:
        raise InputError(f"has {len(picked)} columns of coordinates; at most {_MOST_AXES} can be")
    values, commas = array("d"), _Commas(separator)
    for number, text in lines:
        fields = _split(text, separator)
        if len(fields) != len(first):
            hint = _of_commas(separator) if len(fields) > len(first) else ""
            raise InputError(
                f"line {number}: has {len(fields)} fields, the first line has {len(first)}{hint}"
            )
        for k in picked:
            values.append(_number(fields[k], number, k, commas))
    n_points = len(values) // len(picked)
    if promised is not None and promised != n_points:
        raise InputError(f"line {counted}: says {promised} points, there are {n_points}")
    what = ", ".join(names[k] or f"number {k + 1}" for k in picked) if names else ""
    what = f"columns {what}" if names else f"{len(picked)} columns without names"
    if len(picked) < len(first):
        what += f" of {len(first)}" if names else f" ({_numbers(picked)} of {len(first)})"
    what += ", decimal commas" if commas.seen == "," else ""
    return np.frombuffer(values, dtype=np.float64).reshape(n_points, len(picked)), what


# ---- fields ------------------------------------------------------------------------------------

def _separator(line: tuple[int, str]) -> str | None:
    """What separates the fields of a line; None for white space."""
    number, text = line
    found = next((one for one in (";", "\t", ",") if one in text), None)
    words = text.split()
    if found == "," and len(words) > 1 and all(map(_DECIMAL_COMMA.fullmatch, words)):
        raise InputError(
            f"line {number}: {words[0]!r} has a decimal comma; with these, columns must be "
            "separated by ; or tabs"
        )
    return found


def _split(text: str, separator: str | None) -> list[str]:
    if separator is None:
        return text.split()
    return [field.strip().strip('"').strip() for field in text.split(separator)]


def _of_commas(separator: str | None) -> str:
    return "; with decimal commas, separate the columns by ;" if separator == "," else ""


class _Commas:
    """Whether numbers have commas or points before their decimals: in one file all the same."""

    def __init__(self, separator: str | None) -> None:
        self.may_be = separator in (";", "\t")
        self.seen = ""


def _number(word: str, line: int, k: int, commas: _Commas) -> float:
    where = f"line {line}, field {k + 1}"
    text = word
    if commas.may_be and ("," in word or "." in word):
        mark = "," if "," in word else "."
        if (commas.seen or mark) != mark:
            raise InputError(f"{where}: {word!r}: the file has decimal commas and decimal points")
        commas.seen = mark
        if _DECIMAL_COMMA.fullmatch(word):
            text = word.replace(",", ".")
    if _NUMBER.fullmatch(text):
        value = float(text)
        if math.isfinite(value):
            return value
        raise InputError(f"{where}: {word} is not a finite number")
    if not word:
        raise InputError(f"{where}: is empty")
    if _NOT_FINITE.fullmatch(word):
        raise InputError(f"{where}: {word} is not a finite number")
    raise InputError(f"{where}: {word!r} is not a number")


# ---- columns -----------------------------------------------------------------------------------

def _names_of(fields: list[str]) -> list[str] | None:
    """The fields of a first line as names, or None if it is a point.

    A data frame without names writes an empty one for its index, then 0, 1, 2 ...
    """
    numbers = [field for field in fields if _NUMBER.fullmatch(field.replace(",", "."))]
    is_frame = len(fields) > 1 and fields == ["", *map(str, range(len(fields) - 1))]
    are_names = any(fields) and not numbers and not all(map(_NOT_FINITE.fullmatch, fields))
    return fields if is_frame or are_names else None


def _choose(
    names: list[str] | None, count: int, columns: Sequence[str], line: int, separator: str | None
) -> list[int]:
    """Which columns are coordinates."""
    what = f"{count} columns" if names is None else "columns " + shown_names(map(repr, names))
    if columns:
        picked = []
        for column in columns:
            found = [k for k, name in enumerate(names or ()) if name.lower() == column.lower()]
            if not found and column.isdecimal() and 1 <= int(column) <= count:
                found = [int(column) - 1]
            if len(found) != 1:
                how = "none of the" if not found else "more than one of the"
                raise InputError(f"--columns {column}: names {how} {what}")
            picked += found
        if len(set(picked)) < len(picked):
            raise InputError(f"--columns {','.join(columns)}: names a column twice")
        return picked
    if names is None:
        if count > _MOST_UNNAMED:
            raise InputError(
                f"line {line}: has {count} numbers without names; --columns 1,2,3 says which are "
                f"coordinates{_of_commas(separator)}"
            )
        return list(range(count))
    groups = _groups(names)
    if len(groups) == 1 or "xyz" in groups:
        return groups.get("xyz") or next(iter(groups.values()))
    if groups:
        raise InputError(f"line {line}: {what}: several may be coordinates; choose with --columns")
    raise InputError(
        f"line {line}: {what}: none are known as coordinates; --columns says which are"
    )


def _groups(names: Sequence[str]) -> dict[str, list[int]]:
    """Columns that are coordinates by their names: of each way of naming, in the order of axes."""
    found: dict[str, dict[int, int]] = {}
    plains = [_UNIT.sub("", name.strip().lower()) for name in names]
    axes_of_x = not any(map(_NUMBERED_POINT.fullmatch, plains))  # x0 beside y0 is of a point 0
    for k, plain in enumerate(plains):
        for pattern, axes in _AXES:
            match = pattern.fullmatch(plain)
            stem = match["stem"] if match else None
            if match and (stem in _STEMS or (stem == "x" and axes != "xyz" and axes_of_x)):
                group = found.setdefault(f"{stem}{axes[:3]}", {})
                axis = axes.index(match["axis"])
                group[axis if axis not in group else -1] = k  # -1: named twice
                break
    groups = {}
    for stem, group in found.items():
        first = 1 if stem.endswith("012") and 0 not in group else 0
        if sorted(group) == list(range(first, first + len(group))):
            if stem.endswith("xyz") or len(group) > 1:
                groups[stem] = [group[axis] for axis in sorted(group)]
    return groups


def _numbers(picked: Sequence[int]) -> str:
    return ", ".join(str(k + 1) for k in picked)


def shown_names(names: Iterable[str]) -> str:
    """Names of columns for a message: the first of many."""
    shown = list(names)
    shown[MOST_SHOWN:] = ["..."] * (len(shown) > MOST_SHOWN)
    return ", ".join(shown) or "nothing"
