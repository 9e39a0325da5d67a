# SPDX-License-Identifier: BSD-3-Clause
"""Outputs of the command line: a file is replaced only when the new one is complete."""

from __future__ import annotations

import os
import secrets
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from importlib.util import find_spec
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, missing_extra, one_line


@contextmanager
def replacing(target: str) -> Iterator[IO[bytes]]:
    """Open a file beside `target` that takes its place once the block ends well.

    On any failure, Ctrl-C included, the new file is removed and `target` stays as it was.
    Opening it is also the test that `target` can be written, so enter the block before any
    long work.
    """
    if "\0" in target:
        raise InputError(f"{target!r}: cannot be written: no file has such a name")
    path = os.path.realpath(target)  # a symbolic link keeps pointing to the file
    if os.path.exists(path) and not os.path.isfile(path):
        raise InputError(f"{target}: cannot be written: not a regular file")
    if os.path.exists(path) and not os.access(path, os.W_OK):
        raise InputError(f"{target}: cannot be written: it is read-only")
    folder, name = os.path.split(path)
    temporary = os.path.join(folder, f".{name}.{secrets.token_hex(4)}.part")
    try:
        stream: IO[bytes] = open(temporary, "xb")
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {one_line(error)}") from None
    try:
        with stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        if os.path.exists(path):
            os.chmod(temporary, os.stat(path).st_mode & 0o777)
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {one_line(error)}") from error
    finally:
        if os.path.exists(temporary):
            os.remove(temporary)


# ---- columns -----------------------------------------------------------------------------------

MOST_BYTES = 1e9  # of an output, unless --max-output says otherwise

# About how many characters a number has in text, with what separates it from the next.
_DIGITS_OF_FLOAT, _DIGITS_OF_SHIFT = 19, 3
_ROWS = 1 << 16  # written at a time: some megabytes of text
_PARQUET_ROWS = 1 << 20  # of a row group


def open_output(
    target: str | None,
    source: str | None,
    stack: ExitStack,
    suffixes: tuple[str, ...] = (".npz", ".csv", ".parquet"),
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
        *first, last = suffixes
        raise InputError(f"{target}: the name must end in {', '.join(first)} or {last}")
    if target.lower().endswith(".parquet") and find_spec("pyarrow") is None:
        raise missing_extra(f"{target}: writing Parquet", "pyarrow")
    exist = source is not None and os.path.exists(target) and os.path.exists(source)
    if source is not None and exist and os.path.samefile(target, source):
        raise InputError(f"{target}: is the input; it is not overwritten")
    return stack.enter_context(replacing(target))


def check_size(
    target: str, letters: str, n_pairs: int, n_points: int, ndim: int, most: float | None
) -> None:
    """InputError for an output that would be larger than `most` bytes, told beforehand."""
    most = MOST_BYTES if most is None else most
    in_text = not target.lower().endswith((".npz", ".parquet"))
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
    elif target.lower().endswith(".parquet"):
        pyarrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        series = {name: np.ascontiguousarray(values) for name, values in _series(columns)}
        parquet.write_table(pyarrow.table(series), stream, row_group_size=_PARQUET_ROWS)
    else:
        write_csv(stream, columns)
    stream.flush()


def _series(columns: dict[str, NDArray[Any]]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Each column, and each component of a vector: ``S0``, ``S1``, ``S2``."""
    for letter, column in columns.items():
        if column.ndim == 1:
            yield letter, column
        else:
            yield from ((f"{letter}{k}", column[:, k]) for k in range(column.shape[1]))


def write_csv(stream: IO[bytes], columns: dict[str, NDArray[Any]]) -> None:
    """Write one line an entry; vectors take a column for each component: ``S0,S1,S2``.

    Floats are written with the fewest digits that read back as the same number.
    """
    names, series = zip(*_series(columns), strict=True)
    stream.write((",".join(names) + "\n").encode())
    line = ",".join("%s" if values.dtype.kind == "U" else "%r" for values in series)
    for start in range(0, len(series[0]), _ROWS):
        parts = [values[start : start + _ROWS].tolist() for values in series]
        rows = zip(*parts, strict=True)
        stream.writelines((line % row + "\n").encode() for row in rows)
