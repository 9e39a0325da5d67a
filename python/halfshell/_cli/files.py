# SPDX-License-Identifier: BSD-3-Clause
"""Read a scene from a file that the command line names.

What reads a file is decided by one rule, with the table of docs/command-line.md. Each reader that
may know the format is tried, and the first that yields sensible points wins: at least one point,
finite coordinates, a box of the same dimensions. A box that is a placeholder is left out, and
elements that a residue cannot have are told from the names of its atoms instead. The summary names
the reader, and what it took for coordinates or left out. If no reader wins, the error says what
each of them said.

What stands in a header is compared with the size of the file before any of them demands memory.
Standard input, ``-``, and pipes are copied to a file first.

Everything that a person at a keyboard can get wrong here raises `InputError` with one line
that says what and where.
"""

from __future__ import annotations

import os
import re
import shutil
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell._cli.errors import InputError, missing_extra, one_line, printable
from halfshell._cli.numpy_files import is_numpy, read_arrays
from halfshell._cli.pair_files import refuse_list
from halfshell._cli.structure_files import Frames, Scene, UnknownFormat, by_ase, by_mdanalysis
from halfshell._cli.text_files import kind_of_file, read_points

_TEXT_ALONE, _TEXT_FIRST = (".csv", ".tsv", ".pts"), (".txt", ".dat", "")

_LAST = "as text"  # the reader of text, where it is tried last
_Reader = Callable[[str], Iterable[Scene]]  # the frames of a file, one by one


def read_scene(file: str | None, index: int | None = None, **how: Any) -> Scene:
    """Read one frame of a file, as `read_frames` does; without a file, alpha-quartz."""
    if file is not None:
        (scene,) = read_frames(file, index, **how)
        return scene
    box, periodic = how.pop("box", None), how.pop("periodic", None)
    for name, value in {"index": index, **how}.items():
        if value is not None:
            raise InputError(f"--{name.removeprefix('file_')} needs a file: give one")
    from halfshell.structures import alpha_quartz

    positions, rows, species = alpha_quartz()
    source = "alpha-quartz (ships with halfshell)"
    scene = Scene(positions, rows, (True,) * 3, source, species, "angstrom")
    return _with_overrides(scene, box, periodic)


def read_frames(
    file: str,
    frames: Frames,
    *,
    box: NDArray[np.float64] | None = None,
    periodic: tuple[bool, ...] | None = None,
    file_format: str | None = None,
    columns: Sequence[str] | None = None,
    trajectory: str | None = None,
) -> Iterator[Scene]:
    """Read frames of a file one by one, at least one, by the rule above; none is kept.

    The reader is chosen by the first; one that fails later is an error that names the frame. What
    follows are the options --index, --box, --periodic, --format, --columns and --trajectory. With a
    box all axes repeat unless `periodic` says otherwise.
    """
    with _as_path(file, file_format) as (path, name_of_path):
        source = name_of_path
        claimed = _refuse_claims(path, source)
        if file_format is None and columns is None:
            refuse_list(path, source)
        readers = _readers(path, file_format, frames, columns)
        if trajectory is not None:
            if not os.path.exists(trajectory):
                raise InputError(f"{trajectory}: no such file")
            _refuse_claims(trajectory, trajectory)
            source = f"{source} with {trajectory}"
            whole = partial(by_mdanalysis, file_format=file_format, frames=frames,
                            trajectory=trajectory)  # fmt: skip
            readers = [("MDAnalysis", whole)]
        elif frames is not None and "ASE" not in dict(readers):
            raise InputError(f"{source}: --index is for formats with several frames")
        said: dict[str, str] = {}
        unknown: list[str] = []
        for name, read in readers:
            if name == _LAST and said and kind_of_file(path) != ".xyz":
                continue
            is_chosen = False
            try:
                for scene in read(path):
                    scene = replace(scene, source=source)
                    _check(scene, box is None and periodic is None)
                    is_chosen = True
                    if len(scene.points) < claimed:
                        were = f"{len(scene.points):,} were read"
                        remark = f"its header says {claimed:,} points, {were}"
                        scene = replace(scene, remarks=(*scene.remarks, remark))
                    yield _with_overrides(scene, box, periodic)
                if is_chosen:
                    return
                raise InputError("has none of these frames")
            except UnknownFormat:
                unknown.append(name)
            except (Exception, SystemExit) as error:  # a reader may fail in any way
                said[name] = _reason(error).replace(path, name_of_path)
                # What is left, half made, may fail to end, which Python would print.
                hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
                traceback.clear_frames(error.__traceback__)
                sys.unraisablehook = hook
                if is_chosen or isinstance(error, MemoryError):
                    raise InputError(f"{source}: {said[name]}") from None
    if kind_of_file(path) == "" and len(said) > 1:
        said.pop("text", None)  # a name without a suffix says nothing of text
    raise InputError(f"{source}: {_refusal(said, unknown, file_format)}")


def _reason(error: BaseException) -> str:
    """Why a reader failed, in one line."""
    if isinstance(error, MemoryError):
        return one_line(error) if str(error) else "does not fit in memory"
    if isinstance(error, InputError):
        return one_line(error)
    kind = "" if isinstance(error, OSError) else f"{type(error).__name__}: "
    return f"cannot be read: {kind}{one_line(error)}"


def _refusal(said: dict[str, str], unknown: list[str], file_format: str | None) -> str:
    """What each reader said, in one line."""
    told = [f"{name}: {reason}" for name, reason in said.items()]
    if not unknown:
        return "; ".join(told) if len(set(said.values())) > 1 else next(iter(said.values()))
    form = "the format" if file_format is None else f"the format {file_format!r}"
    strange = f"{' and '.join(unknown)} {'do' if len(unknown) > 1 else 'does'} not know {form}"
    if set(said) <= {_LAST}:
        strange = f"unknown format: {strange} (see `ase info --formats`; force one with --format)"
        return "; ".join([strange, *told])
    return "; ".join([*told, strange])


@contextmanager
def _as_path(file: str, file_format: str | None) -> Iterator[tuple[str, str]]:
    """The path of a file, which standard input and pipes are copied to, and its name for people."""
    is_input = file == "-"
    if not is_input and not os.path.exists(file):
        raise InputError(f"{file}: no such file")
    if not is_input and os.path.isdir(file) and file_format is None and not Path(file).suffix:
        raise InputError(f"{file}: is a folder")
    source = "standard input" if is_input else file
    if not is_input and (os.path.isfile(file) or os.path.isdir(file) or is_numpy(file)):
        yield file, source
        return
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "input" + ("" if is_input else Path(file).suffix))
        try:
            given = nullcontext(sys.stdin.buffer) if is_input else open(file, "rb")
            with given as stream, open(path, "xb") as copy:
                shutil.copyfileobj(stream, copy)
        except OSError as error:
            raise InputError(f"{source}: cannot be read: {one_line(error)}") from None
        yield path, source


def _readers(
    path: str, file_format: str | None, frames: Frames, columns: Sequence[str] | None
) -> list[tuple[str, _Reader]]:
    """The readers that may know a file, by name, in the order in which they are tried."""
    suffix = kind_of_file(path)
    by_text = partial(_by_text, columns=columns or (), is_pts=suffix == ".pts")
    text: list[tuple[str, _Reader]] = [("text", by_text)]
    structures: list[tuple[str, _Reader]] = [
        ("ASE", partial(by_ase, file_format=file_format, frames=frames)),
        ("MDAnalysis", partial(by_mdanalysis, file_format=file_format, frames=frames)),
    ]
    if columns:
        return text
    if file_format is not None:
        return structures
    if is_numpy(path):
        return [("NumPy", _by_numpy)]
    if suffix in CLOUDS:
        return [(one[0], partial(_by_cloud, library=one)) for one in CLOUDS[suffix]]
    if suffix in _TEXT_ALONE:
        return text
    if suffix in _TEXT_FIRST:
        return [*text, *structures]
    return [*structures, (_LAST, partial(by_text, least=2))]


def _by_numpy(path: str) -> list[Scene]:
    if not os.path.isfile(path) and not os.path.isdir(path):  # a pipe may keep us waiting
        raise InputError("cannot be read: not a regular file")
    content, names = read_arrays(path)
    if "points" not in content:
        held = ", ".join(map(printable, names)) or "nothing"
        raise InputError(f"has no array 'points' (it holds {held})")
    points, box = content["points"], content.get("box")
    periodic = np.asarray(content.get("periodic", box is not None))
    if periodic.dtype.kind != "b" or periodic.shape not in ((), (points.shape[1],)):
        raise InputError("'periodic' must be one bool, or one for each column of points")
    flags = np.broadcast_to(periodic, points.shape[1])
    reader = f"NumPy, {' and '.join(content)}"
    return [Scene(points, box, tuple(bool(flag) for flag in flags), reader=reader)]


def _by_text(path: str, columns: Sequence[str], is_pts: bool, least: int = 1) -> list[Scene]:
    points, what = read_points(path, columns, is_pts, least)
    return [Scene(points, None, (False,) * points.shape[1], reader=f"text, {what}")]


# What headers say of the number of points, the least number of bytes for each of them, and the
# suffixes of the format where others may have a number in this place.
_CLAIMS = (
    (re.compile(rb"\s*(\d+)\s"), 2, (".xyz", ".extxyz", ".txyz", ".arc", ".pts")),
    (re.compile(rb"[^\n]*\n\s*(\d+)\s"), 2, (".gro",)),
    (re.compile(rb"(?:\*[^\n]*\n)+\s*(\d+)\b"), 2, (".crd", ".cor")),
    (re.compile(rb"(?:[^\n]*\n){1,4}?\s*(\d+)\s+atoms\b"), 2, ()),  # LAMMPS data
    (re.compile(rb"ITEM: .{,1000}?ITEM: NUMBER OF ATOMS\s+(\d+)", re.S), 2, ()),  # LAMMPS dump
    (re.compile(rb"ply\b.{,20000}?\nelement vertex (\d+)", re.S), 1, ()),
    (re.compile(rb"(?:#[^\n]*\n)*VERSION.{,20000}?\nPOINTS (\d+)", re.S), 1, (".pcd",)),
    (re.compile(rb"# vtk DataFile.{,20000}?\nPOINTS (\d+)", re.S), 2, ()),
)


def _refuse_claims(path: str, source: str) -> int:
    """How many points a header says, or 0; InputError if a file is empty, or cannot hold these."""
    if not os.path.isfile(path):
        return 0
    size = os.path.getsize(path)
    if size == 0:
        raise InputError(f"{source}: is empty")
    try:
        with open(path, "rb") as stream:
            head = stream.read(1 << 16)
        if head[4:8] == b"CORD" or head[8:12] == b"CORD":
            claimed, least = _claim_of_dcd(head), 12
        else:
            kind = kind_of_file(path)
            found = (
                (pattern.match(head), least) for pattern, least, kinds in _CLAIMS
                if not kinds or kind in kinds
            )  # fmt: skip
            claimed, least = next(((int(m[1]), least) for m, least in found if m), (0, 1))
    except (OSError, ValueError, struct.error):
        return 0  # which its reader will say
    if claimed > size // least:
        raise InputError(
            f"{source}: says that it holds {claimed:,} points, more than its {size:,} bytes can"
        )
    return claimed


def _claim_of_dcd(head: bytes) -> int:
    """The number of atoms in the third record of a DCD file, of either order and width."""
    width = 4 if head[4:8] == b"CORD" else 8
    order = "<" if head[0] == 84 else ">"
    at = 0
    for _ in range(2):
        at += struct.unpack_from(f"{order}i", head, at if order == "<" else at + width - 4)[0]
        at += 2 * width
    return int(struct.unpack_from(f"{order}i", head, at + width)[0])


def _check(scene: Scene, with_box: bool) -> None:
    """InputError where points, or points in their box, cannot be searched."""
    frame = scene.frame and f"{scene.frame}: "
    if not len(scene.points):
        raise InputError(f"{frame}holds no points")
    try:
        _ = scene.known if with_box else hs.Points(scene.points)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{frame}{one_line(error)}") from None


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
        frame = scene.frame and f"{scene.frame}: "
        raise InputError(f"{frame}has periodic axes but no box (give --box)")
    return scene


# Point clouds ------------------------------------------------------------------------------


def _by_plyfile(library: Any, file: str) -> NDArray[Any]:
    vertices = library.PlyData.read(file)["vertex"]
    return np.stack([vertices[axis] for axis in "xyz"], axis=1)


_Cloud = tuple[str, Callable[[Any, str], NDArray[Any]]]
_PYVISTA: _Cloud = ("pyvista", lambda library, file: np.array(library.read(file).points))
_PYPCD4: _Cloud = (
    "pypcd4", lambda library, file: library.PointCloud.from_path(file).numpy(("x", "y", "z"))
)  # fmt: skip
# The libraries that read a format, the lighter one first.
CLOUDS: dict[str, tuple[_Cloud, ...]] = {
    ".ply": (("plyfile", _by_plyfile), _PYVISTA), ".pcd": (_PYPCD4,),
    **dict.fromkeys((".obj", ".stl", ".vtk", ".vtp", ".vtu", ".vts", ".vti", ".vtr"), (_PYVISTA,)),
}  # fmt: skip


def _by_cloud(path: str, library: _Cloud) -> list[Scene]:
    name, read = library
    try:
        module: Any = import_module(name)
    except ImportError:
        raise missing_extra("reading this file", name) from None
    reader = f"{name} {getattr(module, '__version__', '')}".strip()
    return [Scene(read(module, path), reader=reader)]
