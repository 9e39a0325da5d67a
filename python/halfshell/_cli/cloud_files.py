# SPDX-License-Identifier: BSD-3-Clause
"""Point clouds: PLY, PCD and VTK files, each by a library that reads it, where one is installed."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import missing_extra

__all__ = ["CLOUDS", "read_cloud"]


def _by_plyfile(library: Any, file: str) -> NDArray[Any]:
    vertices = library.PlyData.read(file)["vertex"]
    return np.stack([np.asarray(vertices[axis]) for axis in "xyz"], axis=1)


def _by_pypcd4(library: Any, file: str) -> NDArray[Any]:
    return np.asarray(library.PointCloud.from_path(file).numpy(("x", "y", "z")))


def _by_pyvista(library: Any, file: str) -> NDArray[Any]:
    return np.array(library.read(file).points)


_Reader = tuple[str, Callable[[Any, str], NDArray[Any]]]
_PLYFILE, _PYPCD4, _PYVISTA = (
    ("plyfile", _by_plyfile), ("pypcd4", _by_pypcd4), ("pyvista", _by_pyvista)
)  # fmt: skip
# The libraries that read a format, the lighter one first.
CLOUDS: dict[str, tuple[_Reader, ...]] = {
    ".ply": (_PLYFILE, _PYVISTA), ".pcd": (_PYPCD4,),
    **dict.fromkeys((".obj", ".stl", ".vtk", ".vtp", ".vtu", ".vts", ".vti", ".vtr"), (_PYVISTA,)),
}  # fmt: skip


def read_cloud(file: str, reader: _Reader) -> tuple[NDArray[Any], str]:
    """The points of a file by one of the libraries, and which.

    Raises
    ------
    InputError
        If it is not installed.
    Exception
        What it raises for broken files.
    """
    name, read = reader
    try:
        library: Any = import_module(name)
    except ImportError:
        raise missing_extra("reading this file", name) from None
    return read(library, file), f"{name} {getattr(library, '__version__', '')}".strip()
