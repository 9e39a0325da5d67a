# SPDX-License-Identifier: BSD-3-Clause
"""Files of the command line: read a scene, replace an output only when it is complete.

Everything that a person at a keyboard can get wrong here raises `InputError` with one line
that says what and where.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell._cli.errors import InputError, one_line
from halfshell._cli.numpy_files import Unreadable, read_arrays
from halfshell._cli.pair_files import refuse_list
from halfshell._cli.structure_files import read_structures
from halfshell._cli.text_files import BadLine, read_points
from halfshell._terminal import printable

__all__ = ["Scene", "read_frames", "read_scene", "replacing"]

_NUMPY, _TEXT = (".npy", ".npz"), (".csv", ".txt", ".dat", ".tsv")
ROWS_CHECKED = 1 << 16  # at a time: some megabytes


@dataclass(frozen=True)
class Scene:
    """Points with their box, and where they come from.

    Attributes
    ----------
    points : ndarray, shape (n, d)
        Finite, n >= 1.
    box : ndarray, shape (d,) or (d, d), or None
        Edge lengths, or edge vectors as rows.
    periodic : tuple of bool, length d
        Which axes repeat.
    source : str
        The file, or what ships with the package; for messages.
    species : ndarray of str, shape (n,), or None
        Chemical symbols, where the file has them.
    unit : str
        ``"angstrom"`` where it is known, else empty.
    remarks : tuple of str
        What the reader of the file warned of.
    """

    points: NDArray[Any]
    box: NDArray[Any] | None
    periodic: tuple[bool, ...]
    source: str
    species: NDArray[np.str_] | None = None
    unit: str = ""
    remarks: tuple[str, ...] = ()

    @property
    def box_rows(self) -> NDArray[np.float64] | None:
        """The edge vectors as rows, shape (d, d), or None."""
        if self.box is None:
            return None
        box = np.asarray(self.box, dtype=np.float64)
        return np.diag(box) if box.ndim == 1 else box


# Reading -----------------------------------------------------------------------------------


def read_scene(
    file: str | None,
    *,
    file_format: str | None = None,
    index: int | None = None,
    box: NDArray[np.float64] | None = None,
    periodic: tuple[bool, ...] | None = None,
) -> Scene:
    """Read points and box from a file.

    Parameters
    ----------
    file : str or None
        A ``.npy`` file with an array (n, d), a ``.npz`` file with ``points`` and perhaps
        ``box`` and ``periodic``, text with one point a line (.csv, .txt, .dat, .tsv), or anything
        that `ase.io.read` reads. None: the block of alpha-quartz that ships with the package.
    file_format : str, optional
        Name of an ASE format; default: told from the file.
    index : int, optional
        Frame, for formats with several; default: the last.
    box : ndarray, shape (d,) or (d, d), optional
        Takes the place of the file's box; all axes repeat unless `periodic` says otherwise.
    periodic : tuple of bool, length 1 or d, optional
        Takes the place of the file's.

    Raises
    ------
    InputError
        With the reason in one line.
    """
    if file is None:
        for option, value in (("--index", index), ("--format", file_format)):
            if value is not None:
                raise InputError(f"{option} needs a file: give one")
        scene = _shipped_scene()
    elif not os.path.exists(file):
        raise InputError(f"{file}: no such file")
    elif os.path.isdir(file) and file_format is None and not Path(file).suffix:
        raise InputError(f"{file}: is a folder")
    elif os.path.isfile(file) and os.path.getsize(file) == 0:
        raise InputError(f"{file}: is empty")
    else:
        suffix = Path(file).suffix.lower()
        refuse_list(file)
        try:
            if file_format is None and suffix in _NUMPY:
                scene = _read_numpy(file, index)
            elif file_format is None and suffix in _TEXT:
                scene = _read_text(file, index)
            else:
                (scene,) = _read_structures(file, file_format, index)
        except MemoryError:
            raise InputError(f"{file}: does not fit in memory") from None
    _check(scene)
    return _with_overrides(scene, box, periodic)


def read_frames(
    file: str,
    frames: slice,
    *,
    file_format: str | None = None,
    box: NDArray[np.float64] | None = None,
    periodic: tuple[bool, ...] | None = None,
) -> list[Scene]:
    """Read some frames of a file, at least one, as `read_scene` reads one.

    Raises
    ------
    InputError
        With the reason in one line.
    """
    if not os.path.exists(file):
        raise InputError(f"{file}: no such file")
    if file_format is None and Path(file).suffix.lower() in (*_NUMPY, *_TEXT):
        raise InputError(f"{file}: --index is for formats with several frames")
    try:
        scenes = _read_structures(file, file_format, frames)
    except MemoryError:
        raise InputError(f"{file}: does not fit in memory") from None
    if not scenes:
        raise InputError(f"{file}: has none of these frames")
    for scene in scenes:
        _check(scene)
    return [_with_overrides(scene, box, periodic) for scene in scenes]


def _shipped_scene() -> Scene:
    from halfshell.structures import alpha_quartz

    positions, box, species = alpha_quartz()
    source = "alpha-quartz (ships with halfshell)"
    return Scene(positions, box, (True,) * 3, source, species, "angstrom")


def _read_numpy(file: str, index: int | None) -> Scene:
    if index is not None:
        raise InputError(f"{file}: --index is for files with several frames, not for NumPy's")
    if not os.path.isfile(file) and not os.path.isdir(file):  # a pipe may keep us waiting
        raise InputError(f"{file}: cannot be read: not a regular file")
    try:
        content, names = read_arrays(file)
    except Unreadable as error:
        raise InputError(f"{file}: {error}") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {one_line(error)}") from None
    except MemoryError as error:
        reason = one_line(error) if str(error) else "it does not fit in memory"
        raise InputError(f"{file}: {reason}") from None
    except Exception as error:  # a broken file may fail in any part of zipfile, zlib and NumPy
        reason = one_line(error)
        if "Object arrays" in reason:
            reason = "it holds Python objects"
        elif "pickled" in reason:  # NumPy's guess where it knows no better
            reason = "it is not one"
        raise InputError(f"{file}: cannot be read as a NumPy file: {reason}") from None
    if "points" not in content:
        held = ", ".join(map(printable, names)) or "nothing"
        raise InputError(f"{file}: has no array 'points' (it holds {held})")
    points, box = content["points"], content.get("box")
    if points.ndim != 2:
        raise InputError(f"{file}: points have shape {points.shape}; they must be (n, d)")
    periodic = np.asarray(content.get("periodic", box is not None))
    if periodic.dtype.kind != "b" or periodic.shape not in ((), (points.shape[1],)):
        raise InputError(f"{file}: 'periodic' must be one bool, or one for each column of points")
    flags = np.broadcast_to(periodic, points.shape[1])
    return Scene(points, box, tuple(bool(flag) for flag in flags), file)


def _read_text(file: str, index: int | None) -> Scene:
    if index is not None:
        raise InputError(f"{file}: --index is for formats with several frames")
    try:
        points = read_points(file)
    except (BadLine, UnicodeDecodeError) as error:
        raise InputError(f"{file}: {one_line(error)}") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {one_line(error)}") from None
    return Scene(points, None, (False,) * points.shape[1], file)


def _read_structures(file: str, file_format: str | None, index: int | slice | None) -> list[Scene]:
    found = read_structures(file, file_format, index)
    return [
        Scene(one.points, one.box, one.periodic, file, one.species, "angstrom", one.remarks)
        for one in found
    ]


def _check(scene: Scene) -> None:
    """Say what is wrong with points or box before anything is computed from them."""
    points, source = scene.points, scene.source
    if points.dtype.kind not in "fiub":
        raise InputError(f"{source}: points are of type {points.dtype}; they must be numbers")
    if not len(points):
        raise InputError(f"{source}: holds no points")
    if points.shape[1] == 0:
        raise InputError(f"{source}: points have shape {points.shape}; they must be (n, d)")
    for first in range(0, len(points), ROWS_CHECKED):
        block = points[first : first + ROWS_CHECKED]
        if not np.isfinite(block).all():
            row, column = (int(k) for k in np.argwhere(~np.isfinite(block))[0])
            value = block[row, column]
            raise InputError(f"{source}: point {first + row}, coordinate {column} is {value}")
    if scene.box is None:
        return
    ndim = points.shape[1]
    if scene.box.dtype.kind not in "fiu" or not np.isfinite(scene.box).all():
        raise InputError(f"{source}: the box must be finite numbers, it is {scene.box.tolist()}")
    if scene.box.shape not in ((ndim,), (ndim, ndim)):
        raise InputError(
            f"{source}: the box has shape {scene.box.shape}; "
            f"it must be ({ndim},) or ({ndim}, {ndim})"
        )


def _with_overrides(
    scene: Scene, box: NDArray[np.float64] | None, periodic: tuple[bool, ...] | None
) -> Scene:
    """Put --box and --periodic in the place of what the file says."""
    ndim = scene.points.shape[1]
    if box is not None:
        box = np.repeat(box, ndim) if box.size == 1 else box
        if box.size == 6 and ndim == 3:
            try:
                box = hs.Box.from_dimensions(box).vectors.ravel()
            except ValueError as error:
                raise InputError(f"--box: {one_line(error)}") from None
        if box.size not in (ndim, ndim * ndim):
            raise InputError(
                f"--box has {box.size} numbers; points with {ndim} coordinates need "
                f"{ndim} (lengths) or {ndim * ndim} (vectors)"
                + (", or 6 (lengths and angles)" if ndim == 3 else "")
            )
        box = box if box.size == ndim else box.reshape(ndim, ndim)
        scene = replace(scene, box=box, periodic=(True,) * ndim)
    if periodic is not None:
        if len(periodic) not in (1, ndim):
            raise InputError(
                f"--periodic has {len(periodic)} letters; points with {ndim} coordinates "
                f"need 1 or {ndim}"
            )
        scene = replace(scene, periodic=periodic * (ndim // len(periodic)))
    if scene.box is None and any(scene.periodic):
        raise InputError(f"{scene.source}: has periodic axes but no box (give --box)")
    return scene


# Writing -----------------------------------------------------------------------------------


@contextmanager
def replacing(target: str) -> Iterator[IO[bytes]]:
    """Open a file beside `target` that takes its place once the block ends well.

    On any failure, Ctrl-C included, the new file is removed and `target` stays as it was.
    Opening it is also the test that `target` can be written, so enter the block before any
    long work.

    Parameters
    ----------
    target : str
        The file to replace or to make.

    Yields
    ------
    binary file
        Open for writing.

    Raises
    ------
    InputError
        If `target` cannot be written.
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
