# SPDX-License-Identifier: BSD-3-Clause
"""Structures and trajectories, in the formats of ASE, or else of MDAnalysis."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, missing_extra, one_line

__all__ = ["Structure", "read_structures"]


class Structure(NamedTuple):
    """A frame of a file: coordinates in angstrom, edge vectors or None, periodic axes, elements."""

    points: NDArray[Any]
    box: NDArray[np.float64] | None
    periodic: tuple[bool, ...]
    species: NDArray[np.str_] | None
    remarks: tuple[str, ...]


def read_structures(
    file: str, file_format: str | None, index: int | slice | None
) -> list[Structure]:
    """The frames that are meant: one, by default the last, unless `index` is a range.

    Raises
    ------
    InputError
        With the reason in one line.
    """
    try:
        import ase.io
        from ase.io.formats import UnknownFileTypeError
    except ImportError:
        found = None if file_format else _by_mdanalysis(file, index)
        if found is None:
            raise missing_extra(f"{file}: reading this file", "ase") from None
        return found
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            atoms: Any = ase.io.read(
                file,
                index=-1 if index is None else index,
                format=file_format,
                do_not_split_by_at_sign=True,
            )
        except UnknownFileTypeError as error:
            found = None if file_format else _by_mdanalysis(file, index)
            if found is not None:
                return found
            name = file_format or one_line(error)
            raise InputError(
                f"{file}: unknown format{f' {name!r}' if name else ''} "
                "(see `ase info --formats`; force one with --format)"
            ) from None
        except OSError as error:
            raise InputError(f"{file}: cannot be read: {one_line(error)}") from None
        except (IndexError, StopIteration) as error:
            what = f"has no frame {index}" if isinstance(index, int) else "holds no atoms"
            detail = f" ({one_line(error)})" if str(error) else ""
            raise InputError(f"{file}: {what}{detail}") from None
        except MemoryError:
            raise
        except Exception as error:  # a reader may fail in any way on a broken file
            raise _unreadable(file, error) from None
    remarks = _remarks(caught)
    return [
        Structure(
            one.positions,
            one.cell.array if one.cell.rank > 0 else None,
            tuple(bool(flag) for flag in one.pbc),
            np.array(one.get_chemical_symbols()),
            remarks,
        )
        for one in (atoms if isinstance(index, slice) else [atoms])
    ]


def _by_mdanalysis(file: str, index: int | slice | None) -> list[Structure] | None:
    """Frames as MDAnalysis reads them; None where it is missing or does not know the format."""
    try:
        import MDAnalysis
    except ImportError:
        return None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            universe = MDAnalysis.Universe(file, to_guess=("elements",))
            trajectory = universe.trajectory
        except MemoryError:
            raise
        except (ValueError, TypeError, NotImplementedError):
            return None  # what it does not know
        except Exception as error:
            raise _unreadable(file, error) from None
        try:
            numbers = range(len(trajectory))
            one = -1 if index is None else index
            chosen = numbers[one] if isinstance(one, slice) else [numbers[one]]
        except IndexError:
            raise InputError(f"{file}: has no frame {index}") from None
        elements = getattr(universe.atoms, "elements", None)
        remarks = _remarks(caught)
        return [_frame(trajectory[number], elements, remarks) for number in chosen]


def _frame(frame: Any, elements: Any, remarks: tuple[str, ...]) -> Structure:
    box = None if frame.dimensions is None else frame.triclinic_dimensions.astype(np.float64)
    return Structure(
        frame.positions.copy(), box, (box is not None,) * 3,
        None if elements is None else np.array([str(name) for name in elements]), remarks,
    )  # fmt: skip


def _remarks(caught: Any) -> tuple[str, ...]:
    texts = (" ".join(str(w.message).split()) for w in caught
             if issubclass(w.category, UserWarning))  # fmt: skip
    return tuple(dict.fromkeys(texts))


def _unreadable(file: str, error: Exception) -> InputError:
    return InputError(f"{file}: cannot be read: {type(error).__name__}: {one_line(error)}")
