# SPDX-License-Identifier: BSD-3-Clause
"""``.npy`` and ``.npz`` files: what they hold is known, and refused, before it is unpacked.

A few megabytes can unpack to more than the memory that there is, and a header can promise more than
the file has.
"""

from __future__ import annotations

import io
import math
import os
import warnings
import zipfile
from collections.abc import Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, one_line
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.points import MAX_DIM, MAX_POINTS

_SCENE = ("points", "box", "periodic")
_MAGIC = np.lib.format.MAGIC_PREFIX
MOST_HEADER = 10_000  # bytes, as np.load has it
_COPIES = 2  # of the points: what is read, and the search's own


def is_numpy(file: str) -> bool:
    """Whether a file is one by its name, or without one by what it begins with."""
    suffix = os.path.splitext(file)[1]
    if suffix or not os.path.isfile(file):
        return suffix.lower() in (".npy", ".npz")
    with open(file, "rb") as stream:
        start = stream.read(len(_MAGIC))
    return start == _MAGIC or start.startswith(b"PK\x03\x04")


def read_arrays(
    file: str, wanted: Sequence[str] = _SCENE
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Read some arrays, by name, as far as they are there; and the names of all that it holds.

    That of a ``.npy`` file is `points`, or ``alone`` if others are wanted. MemoryError if they
    would not fit, OSError if the file cannot be read.
    """
    try:
        return _read(file, wanted)
    except (InputError, OSError, MemoryError):
        raise
    except Exception as error:  # a broken file may fail in any part of zipfile, zlib and NumPy
        reason = one_line(error)
        if "Object arrays" in reason:
            reason = "it holds Python objects"
        elif "pickled" in reason:  # NumPy's guess where it knows no better
            reason = "it is not one"
        raise InputError(f"cannot be read as a NumPy file: {reason}") from None


def _read(file: str, wanted: Sequence[str]) -> tuple[dict[str, NDArray[Any]], list[str]]:
    with open(file, "rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of headers that Python 2 wrote
        alone = "points" if "points" in wanted else "alone"
        if stream.peek(len(_MAGIC)).startswith(_MAGIC):
            _check_header(alone, stream, os.fstat(stream.fileno()).st_size)
            if alone not in wanted:
                return {}, [alone]
            stream.seek(0)
        loaded = np.load(stream, allow_pickle=False, max_header_size=MOST_HEADER)
        if isinstance(loaded, np.ndarray):
            return {alone: loaded}, [alone]
        names = list(loaded.files)
        held = [name for name in wanted if name in names]
        return {name: loaded[name] for name in held if _is_array(name, loaded.zip)}, names


def _is_array(name: str, archive: zipfile.ZipFile) -> bool:
    """Whether a member is a NumPy file: then with `_check_header`, else it is not read."""
    member = name if name in archive.namelist() else f"{name}.npy"
    with archive.open(member) as part:
        if part.read(len(_MAGIC)) != _MAGIC:
            return False
    with archive.open(member) as part:
        _check_header(name, part, archive.getinfo(member).file_size)
    return True


def _check_header(name: str, stream: IO[bytes], n_bytes: int) -> None:
    """Refuse an array that cannot be used, or of which its `n_bytes` do not hold all."""
    header = _read_header(stream)
    if header is None or header[1].hasobject:
        return  # NumPy refuses it
    shape, dtype, n_header = header
    n_bytes -= n_header
    if min(shape, default=0) < 0:
        raise InputError(f"{name!r} has shape {shape}; no length is negative")
    needed = math.prod(shape) * dtype.itemsize
    what = f"{name!r} of shape {shape} and dtype {dtype}"
    if name in ("box", "periodic"):
        if math.prod(shape) > MAX_DIM**2:
            raise InputError(f"{name!r} has shape {shape}, more than a box has")
    elif name != "points":
        pass
    elif len(shape) != 2:
        raise InputError(f"points have shape {shape}; they must be (n, d)")
    elif shape[1] > MAX_DIM:
        raise InputError(f"points have shape {shape}; they must be (n, d) with d <= {MAX_DIM}")
    elif shape[0] > MAX_POINTS:
        raise InputError(f"points have shape {shape}; fewer than 2**31 points can be searched")
    if needed > n_bytes:
        raise InputError(f"{what} is cut off: that is {needed:,} bytes, there are {n_bytes:,}")
    refuse_unavailable(_COPIES * needed, f"{what}, read and searched,")


def _read_header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any], int] | None:
    """Shape and type of an array, and the bytes before its data; None if the header is none."""
    start = stream.read(12)
    if len(start) < 12 or not start.startswith(_MAGIC):
        return None
    is_old = start[6] == 1
    length = int.from_bytes(start[8:10] if is_old else start[8:12], "little")
    if length > MOST_HEADER:
        raise InputError(f"its header of {length:,} bytes is too long")
    whole = io.BytesIO(start + stream.read(length))
    try:
        np.lib.format.read_magic(whole)
        read = (np.lib.format.read_array_header_1_0 if is_old
                else np.lib.format.read_array_header_2_0)  # fmt: skip
        shape, _, dtype = read(whole)
    except ValueError:
        return None
    return shape, dtype, length + (10 if is_old else 12)
