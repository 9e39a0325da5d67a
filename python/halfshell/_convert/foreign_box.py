# SPDX-License-Identifier: BSD-3-Clause
"""Boxes of other libraries, told by their attributes: none of these libraries is imported.

``freud.box.Box`` has columns as vectors, and says which axes repeat. A ``Trajectory`` of mdtraj has
the rows of each frame, a ``Timestep`` of MDAnalysis its own.
"""

from __future__ import annotations

import sys
import warnings
from typing import Any

import numpy as np

from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import attribute, kind_of, told

_MISSING = object()


def foreign_vectors(values: Any, name: str, ndim: int | None = None) -> Any:
    """Vectors as rows, of a box of one of these libraries; else the object itself.

    A flat box is one of two dimensions where these are so many, else has a third vector of zeros.
    """
    if callable(attribute(values, "to_matrix", name)):
        matrix = as_array(_matrix_of(values, name), name)
        rows = matrix.T if matrix.ndim == 2 else matrix
        return rows[:2, :2] if ndim == 2 and rows.shape == (3, 3) and is_flat(values) else rows
    for source in ("unitcell_vectors", "triclinic_dimensions"):
        vectors = attribute(values, source, name, _MISSING)
        if vectors is _MISSING:
            continue
        if vectors is None:
            raise ValueError(f"{name} must be a box, got a {kind_of(values)} that has none")
        vectors = as_array(vectors, name)
        if vectors.ndim == 3 and source == "unitcell_vectors":
            if len(vectors) != 1:
                raise ValueError(
                    f"{name} must be that of one frame, got a {kind_of(values)} of {len(vectors)}"
                )
            vectors = vectors[0]
        return vectors
    return values


def is_flat(box: Any) -> bool:
    """Whether a box of freud has two dimensions."""
    dimensions = attribute(box, "dimensions", "box")
    return isinstance(dimensions, int) and dimensions == 2


def foreign_periodic(box: Any, ndim: int) -> Any:
    """Which axes of a box repeat, if it is one that says so; else None."""
    if type(box) in (np.ndarray, list, tuple) or not callable(attribute(box, "to_matrix", "box")):
        return None
    flags = as_array(attribute(box, "periodic", "box"), "periodic")
    if flags.shape != (3,) or flags.dtype.kind != "b":
        return None
    flags = flags & [True, True, not is_flat(box)]
    return flags[:2] if ndim == 2 else flags


def placeholder(rows: Any, is_pdb: bool) -> str:
    """Why a box is none, which a file or an object has only because a box must stand there.

    Vectors that are all zero, as lengths or angles of zero make them; in what PDB or mmCIF files
    say, where lengths are in angstrom, also a cube of 1 x 1 x 1. Else nothing.
    """
    rows = np.asarray(rows, dtype=np.float64)
    if not rows.any():
        return "its lengths or angles are zero"
    if is_pdb and np.array_equal(rows, np.eye(len(rows))):
        return "1 x 1 x 1 is a placeholder in such files"
    return ""


def without_placeholder(vectors: Any, name: str, is_pdb: bool = False) -> Any:
    """The vectors that an object brings, or None with a warning if they are a placeholder."""
    if vectors is None:
        return None
    rows = as_array(vectors, "box")
    reason = placeholder(rows, is_pdb) if rows.dtype.kind in "fiu" else ""
    if not reason:
        return vectors
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals["__name__"].startswith("halfshell."):
        level, frame = level + 1, frame.f_back
    warnings.warn(f"the box of {name} is left out: {reason}", UserWarning, stacklevel=level)
    return None


def _matrix_of(box: Any, name: str) -> Any:
    try:
        return box.to_matrix()
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(
            f"{name} cannot be read: {kind_of(box)}.to_matrix raised {kind_of(error)}: "
            f"{told(error)}"
        ) from error
