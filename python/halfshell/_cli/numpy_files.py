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
        arrays, members = {}, loaded.zip.namelist()
        for name in [name for name in wanted if name in loaded.files]:
            member = name if name in members else f"{name}.npy"
            with loaded.zip.open(member) as part:
                if not part.peek(len(_MAGIC)).startswith(_MAGIC):
                    continue
                _check_header(name, part, loaded.zip.getinfo(member).file_size)
            arrays[name] = loaded[name]
        return arrays, list(loaded.files)


def _check_header(name: str, stream: IO[bytes], n_bytes: int) -> None:
    """Refuse an array that cannot be used, or of which its `n_bytes` do not hold all."""
    start = io.BytesIO(stream.read(MOST_HEADER))
    is_old = np.lib.format.read_magic(start) == (1, 0)
    read = np.lib.format.read_array_header_1_0 if is_old else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(start)
    if dtype.hasobject:
        return  # NumPy refuses it
    if min(shape, default=0) < 0:
        raise InputError(f"{name!r} has shape {shape}; no length is negative")
    if name in ("box", "periodic") and math.prod(shape) > MAX_DIM**2:
        raise InputError(f"{name!r} has shape {shape}, more than a box has")
    if name == "points":
        if len(shape) != 2 or shape[1] > MAX_DIM:
            raise InputError(f"points have shape {shape}; they must be (n, d) with d <= {MAX_DIM}")
        if shape[0] > MAX_POINTS:
            raise InputError(f"points have shape {shape}; fewer than 2**31 points can be searched")
    needed, n_bytes = math.prod(shape) * dtype.itemsize, n_bytes - start.tell()
    what = f"{name!r} of shape {shape} and dtype {dtype}"
    if needed > n_bytes:
        raise InputError(f"{what} is cut off: that is {needed:,} bytes, there are {n_bytes:,}")
    refuse_unavailable(_COPIES * needed, f"{what}, read and searched,")
