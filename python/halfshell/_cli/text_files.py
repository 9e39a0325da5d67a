# SPDX-License-Identifier: BSD-3-Clause
"""Points in text: one a line, fields apart by semicolons, tabs, commas or spaces.

Coordinates are the columns that `--columns` names, or those that names of a header tell (``x y z``,
``pos_x``, ``x [nm]``, ``Points:0`` ...), or all of up to three columns without names. Anything else
is refused with the line and the field: an index, a mass or a list of pairs is no coordinate.
"""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?", re.ASCII)
_QUOTED = re.compile(r"\"[^\"]*\"|(?<![^\s;|,])'[^']*'")  # single ones where a field begins
_MOST_UNNAMED = 3
_AT_ONCE = 4096  # lines
_MOST_AXES = 8
MOST_SHOWN = 12  # names of columns in a message
_NOT_COMMA = (";", "\t", "|")  # what separates fields that may have decimal commas
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

    columns: names, or numbers from 1 on, of those that are coordinates; default: told from the
    names. is_pts: columns without names are those of a PTS file: x y z, intensity, colours. least:
    of coordinates, in a file that its name does not tell to be text.
    """
    with open_text(file, _groups) as text:
        names, width = text.names, text.width
        if names is None and is_pts:
            names = _PTS.get(width)
        picked = _choose(names, width, columns, text)
        if len(picked) > _MOST_AXES:
            raise InputError(
                f"has {len(picked)} columns of coordinates; at most {_MOST_AXES} can be"
            )
        points = text.read(picked)
    if len(points) and points.shape[1] < least:
        raise InputError(f"has {points.shape[1]} column of numbers")
    if names:
        what = "columns " + ", ".join(names[k] or f"number {k + 1}" for k in picked)
        what += f" of {width}" if len(picked) < width else ""
    else:
        what = f"{len(picked)} columns without names"
        if len(picked) < width:
            what += f" ({', '.join(str(k + 1) for k in picked)} of {width})"
    return points, what + (", decimal commas" if text.mark == "," else "")


@contextmanager
def open_text(file: str, are_names: Callable[[Sequence[str]], object]) -> Iterator[Text]:
    """Open a text file with columns for reading; see `Text`."""
    with io.TextIOWrapper(open_bytes(file), encoding="utf-8-sig") as stream:
        try:
            yield Text(stream, are_names)
        except UnicodeDecodeError:
            raise InputError("is not text") from None


class Text:
    """Text with columns: how many, what separates them, and their names, from its first lines.

    Empty lines, and what is behind ``#``, are left out. A first line that holds no number is one of
    names; so is a remark right before the first row if `are_names` finds some in its words. A first
    line that holds one whole number, where others hold more, says how many rows there are.
    """

    def __init__(self, stream: Iterable[str], are_names: Callable[[Sequence[str]], object]) -> None:
        self.remark = ""
        self.promised: tuple[int, int] | None = None  # the line that says how many rows, and these
        self.mark = ""  # before the decimals of all numbers, once there are some
        self._lines = enumerate(stream, 1)
        head = list(islice(self._filled(self._lines), 2))
        if len(head) == 2 and head[0][1].isdecimal():
            if len(_split(head[1][1], _separator(*head[1]))) > 1:
                number, count = head.pop(0)
                self.promised = number, int(count)
        self.line, text = head[0] if head else (0, "")
        self.separator = _separator(self.line, text or self.remark)
        self.first = _split(text, self.separator)  # the fields of the first line
        self.width, self.names = len(self.first), _names_of(self.first)
        if self.names is not None:
            head.pop(0)
        else:
            told = _split(self.remark, self.separator)
            if (len(told) == self.width or not head) and are_names(told):
                self.names, self.width = told, len(told)
        self._head = head

    def _filled(self, lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        """Lines that hold something, with their numbers."""
        for number, line in lines:
            text, _, remark = line.partition("#")
            if text.strip():
                yield number, text.strip(" \r\n")
            else:
                self.remark = remark.strip() or self.remark

    def read(self, picked: Sequence[int]) -> NDArray[np.float64]:
        """The numbers in some of the columns, one row a line."""
        values = array("d")
        while lines := self._head or list(islice(self._lines, _AT_ONCE)):
            self._head = []
            found = self._read_plain(lines, picked)
            if found is None:
                for number, text in self._filled(lines):
                    values.extend(self._row(number, text, picked))
            else:
                values.frombytes(found.tobytes())
        points = np.frombuffer(values, dtype=np.float64).reshape(-1, max(1, len(picked)))
        if self.promised is not None and self.promised[1] != len(points):
            line, count = self.promised
            raise InputError(f"line {line}: says {count} points, there are {len(points)}")
        return points

    def _read_plain(
        self, lines: list[tuple[int, str]], picked: Sequence[int]
    ) -> NDArray[np.float64] | None:
        """The numbers in lines that NumPy reads as `_row` does; None for all others."""
        texts = [text for _, text in lines]
        if self.separator is None:
            widths = {len(text.split()) for text in texts}
        else:
            widths = {text.count(self.separator) + 1 for text in texts}
        has_marks = self.separator in _NOT_COMMA and self.mark != "."  # which are to be compared
        if widths != {self.width} or (has_marks and (self.mark or "." in "".join(texts))):
            return None
        try:
            found = np.loadtxt(texts, delimiter=self.separator, comments=None, usecols=picked,
                               ndmin=2)  # fmt: skip
        except ValueError:
            return None
        return found if np.isfinite(found).all() else None

    def _row(self, number: int, text: str, picked: Sequence[int]) -> list[float]:
        """The numbers in one line."""
        fields = _split(text, self.separator)
        if len(fields) != self.width:
            said = f"has {len(fields)} fields, the first line has {self.width}"
            hint = self.hint(fields) if len(fields) > self.width else ""
            raise InputError(f"line {number}: {said}{hint}")
        return [self._number(fields[k], f"line {number}, field {k + 1}") for k in picked]

    def hint(self, fields: Sequence[str]) -> str:
        """What may be wrong with a line that has too many fields."""
        if len(fields) == self.width + 1 and not fields[-1]:
            return f"; it ends with {self.separator!r}, which the first line does not"
        is_whole = all(field.lstrip("+-").isdecimal() for field in fields)
        if self.separator == "," and is_whole and len(fields) > _MOST_UNNAMED:
            return "; with decimal commas, separate the columns by ;"
        return ""

    def _number(self, word: str, where: str) -> float:
        """A field as a number; decimals are behind commas or points, in one file all the same."""
        text = word
        if self.separator in _NOT_COMMA and ("," in word or "." in word):
            mark = "," if "," in word else "."
            if (self.mark or mark) != mark:
                raise InputError(
                    f"{where}: {word!r}: the file has decimal commas and decimal points"
                )
            self.mark = mark
            if _DECIMAL_COMMA.fullmatch(word):
                text = word.replace(",", ".")
        if _NUMBER.fullmatch(text) and math.isfinite(value := float(text)):
            return value
        if not word:
            raise InputError(f"{where}: is empty")
        if _NUMBER.fullmatch(text) or _NOT_FINITE.fullmatch(word):
            raise InputError(f"{where}: {word} is not a finite number")
        raise InputError(f"{where}: {word!r} is not a number")


def _separator(line: int, text: str) -> str | None:
    """What separates the fields of a line; None for white space."""
    plain = _QUOTED.sub("", text)
    found = next((one for one in (";", "\t", "|", ",") if one in plain), None)
    words = text.split()
    if found == "," and len(words) > 1 and all(map(_DECIMAL_COMMA.fullmatch, words)):
        raise InputError(
            f"line {line}: {words[0]!r} has a decimal comma; with these, columns must be "
            "separated by ; or tabs"
        )
    return found


def _split(text: str, separator: str | None) -> list[str]:
    """The fields of a line, without quotes around them, which are double or single ones."""
    fields = text.split(separator)
    quotes = [one for one in "\"'" if any(field.strip().startswith(one) for field in fields)]
    for quote in quotes[:1]:  # quoted fields may hold what separates others
        (fields,) = csv.reader([text] if separator else [" ".join(fields)],
                               delimiter=separator or " ", quotechar=quote,
                               skipinitialspace=True)  # fmt: skip
    return [field.strip().strip("".join(quotes)).strip() for field in fields]


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
    names: list[str] | None, count: int, columns: Sequence[str], text: Text
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
                f"line {text.line}: has {count} numbers without names; --columns 1,2,3 says which "
                f"are coordinates{text.hint(text.first)}"
            )
        return list(range(count))
    groups = _groups(names)
    if len(groups) == 1 or "xyz" in groups:
        return groups.get("xyz") or next(iter(groups.values()))
    if groups:
        why = "several may be coordinates; choose with --columns"
    else:
        why = "none are known as coordinates; --columns says which are"
    raise InputError(f"line {text.line}: {what}: {why}")


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


def shown_names(names: Iterable[str]) -> str:
    """Names of columns for a message: the first of many."""
    shown = list(names)
    shown[MOST_SHOWN:] = ["..."] * (len(shown) > MOST_SHOWN)
    return ", ".join(shown) or "nothing"
