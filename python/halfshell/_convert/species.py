# SPDX-License-Identifier: BSD-3-Clause
"""Cutoffs by kind of point, as a dict of pairs: kinds are numbers, names, or elements of ASE.

A dict becomes a table of its kinds and, in the last row, of all others, which are no pairs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array, one_each
from halfshell._convert.atom_groups import elements_of
from halfshell._convert.foreign import attribute, is_a, kind_of, shown, told, whole_number
from halfshell._convert.labels import as_names
from halfshell._convert.lengths import as_number
from halfshell._convert.marks import as_types
from halfshell._convert.scene import brings_its_box

if TYPE_CHECKING:
    from halfshell._convert.given import Given, Sets
    from halfshell._convert.types import FloatArray

# By atomic number; 0 stands for what is no element.
SYMBOLS = """
X H He Li Be B C N O F Ne Na Mg Al Si P S Cl Ar K Ca Sc Ti V Cr Mn Fe Co Ni Cu Zn Ga Ge As Se Br Kr
Rb Sr Y Zr Nb Mo Tc Ru Rh Pd Ag Cd In Sn Sb Te I Xe Cs Ba La Ce Pr Nd Pm Sm Eu Gd Tb Dy Ho Er Tm Yb
Lu Hf Ta W Re Os Ir Pt Au Hg Tl Pb Bi Po At Rn Fr Ra Ac Th Pa U Np Pu Am Cm Bk Cf Es Fm Md No Lr Rf
Db Sg Bh Hs Mt Ds Rg Cn Nh Fl Mc Lv Ts Og
""".split()
_ATOMIC_NUMBERS = {symbol: number for number, symbol in enumerate(SYMBOLS)}


class _Kinds(NamedTuple):
    """The kind of each point of a set."""

    values: npt.NDArray[Any]  # numbers, or names
    are_elements: bool = False  # numbers are atomic numbers, as a dict names them by symbol

    @property
    def are_names(self) -> bool:
        return bool(self.values.dtype.kind == "U")


def types_of_species(
    cutoff: Mapping[Any, Any], given: Given, sets: Sets
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32] | None, FloatArray]:
    """Types of the points and of the queries, and the table for them; -1 where pairs are none."""
    kinds = [_kinds(given.types, "types", sets.points, "points", sets.n)]
    if sets.q is not None:
        kinds.append(_kinds(given.query_types, "query_types", sets.queries, "queries", sets.q))
        kinds = _alike(*kinds)
    # Where there are no points, nothing says whether types are names.
    lengths = _lengths(cutoff, kinds) if any(len(kind.values) for kind in kinds) else {}
    names = np.array(sorted({name for pair in lengths for name in pair}))
    rows = {name: row for row, name in enumerate(names.tolist())}
    table = np.full((len(names) + 1, len(names) + 1), -1.0)
    for (a, b), length in lengths.items():
        table[rows[a], rows[b]] = table[rows[b], rows[a]] = length
    types = [_places(kind.values, names) for kind in kinds]
    return types[0], types[1] if len(types) > 1 else None, table


def _places(values: npt.NDArray[Any], names: npt.NDArray[Any]) -> npt.NDArray[np.int32]:
    """Where each is among the names, which ascend; their number for all that are not there."""
    if len(names) == 0:
        return np.zeros(len(values), np.int32)
    places = np.minimum(np.searchsorted(names, values), len(names) - 1)
    return np.where(names[places] == values, places, len(names)).astype(np.int32)


# ---- kinds of points -----------------------------------------------------------------------


def _kinds(values: Any, name: str, owner: Any, owners: str, n: int) -> _Kinds:
    """As they are given, or those of an object that has elements."""
    if values is None:
        found = _elements_of(owner, owners)
        if found is None:
            raise TypeError(
                f"{name} must be given if cutoff is a dict, unless {owners} are an object that "
                "knows its elements, such as ase.Atoms"
            )
        kinds, name = found, f"elements of {owners}"
    else:
        array = as_array(values, name, "hold integers or names")
        names = as_names(array)
        kinds = _Kinds(as_types(array, name, n) if names is None else names)
    one_each(name, n)(kinds.values.shape)
    return kinds


def _elements_of(owner: Any, owners: str) -> _Kinds | None:
    """Atomic numbers, or names where it has no numbers; None for what is no such object."""
    if not brings_its_box(owner, owners):
        return None
    numbers = attribute(owner, "numbers", owners)
    if numbers is None:
        numbers = attribute(owner, "atomic_numbers", owners)  # of pymatgen
    if numbers is not None:
        array = as_array(numbers, f"{owners}.numbers", "hold integers")
        if array.dtype.kind not in "iu":
            raise TypeError(f"{owners}.numbers must hold integers, got dtype {array.dtype}")
        for k in np.flatnonzero((array < 0) | (array >= len(SYMBOLS))):
            raise ValueError(
                f"{owners}.numbers must be below {len(SYMBOLS)}, got numbers[{k}] = {array[k]}"
            )
        return _Kinds(array.astype(np.int32), are_elements=True)
    symbols = attribute(owner, "get_chemical_symbols", owners)
    if symbols is None:
        elements = elements_of(owner, owners)
        names = None if elements is None else as_names(as_array(elements, owners, "hold names"))
        return None if names is None else _Kinds(names)
    try:
        return _Kinds(np.array(symbols(), np.str_))
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(
            f"{owners} cannot be read: {kind_of(owner)}.get_chemical_symbols raised "
            f"{kind_of(error)}: {told(error)}"
        ) from error


def _alike(own: _Kinds, asking: _Kinds) -> list[_Kinds]:
    """Kinds of both sets by numbers, or by names."""
    both = [own, asking]
    if own.are_names != asking.are_names:
        both = [
            _Kinds(np.array(SYMBOLS)[kinds.values]) if kinds.are_elements else kinds
            for kinds in both
        ]
    if both[0].are_names != both[1].are_names or both[0].are_elements != both[1].are_elements:
        raise ValueError("types and query_types must both be numbers, or both be names")
    return both


# ---- the dict ------------------------------------------------------------------------------


def _lengths(cutoff: Mapping[Any, Any], kinds: list[_Kinds]) -> dict[tuple[Any, Any], float]:
    """The cutoff of each pair of kinds, in one order of the two."""
    lengths: dict[tuple[Any, Any], float] = {}
    for key, value in _items(cutoff):
        where = f"cutoff[{shown(key)}]"
        if not is_a(key, tuple) or len(key) != 2:
            raise TypeError(
                f"cutoff must have pairs of types as keys, such as ('Si', 'O'), got {shown(key)}"
            )
        length = as_number(value, where)
        if not (math.isfinite(length) and length >= 0.0):
            raise ValueError(f"{where} must be finite and not negative, got {length}")
        one, other = (_name(part, where, kinds) for part in key)
        pair = min((one, other), (other, one))
        if lengths.setdefault(pair, length) != length:
            raise ValueError(
                f"{where} = {length} contradicts another cutoff of the same two, {lengths[pair]}"
            )
    return lengths


def _items(cutoff: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    try:
        return list(cutoff.items())
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(
            f"cutoff cannot be read: {kind_of(cutoff)} raised {kind_of(error)}: {told(error)}"
        ) from error


def _name(part: Any, where: str, kinds: list[_Kinds]) -> Any:
    """A part of a key as kinds are written."""
    if is_a(part, str):
        symbol = str.__str__(part)
        if kinds[0].are_names:
            if symbol in _ATOMIC_NUMBERS or any((k.values == symbol).any() for k in kinds):
                return symbol
            raise ValueError(f"{where}: {shown(part)} is neither an element nor a type of a point")
        if not kinds[0].are_elements:
            raise ValueError(f"{where} has names, and types are numbers")
        if symbol not in _ATOMIC_NUMBERS:
            raise ValueError(f"{where}: {shown(part)} is not the symbol of an element")
        return _ATOMIC_NUMBERS[symbol]
    number = whole_number(part, "cutoff")
    if number is None or isinstance(number, bool):
        raise TypeError(f"{where} must have types or names as its key, got {shown(part)}")
    if kinds[0].are_names:
        raise ValueError(f"{where} has numbers, and types are names")
    most = len(SYMBOLS) - 1 if kinds[0].are_elements else 2**31 - 2
    if not 0 <= number <= most:
        raise ValueError(f"{where} must have types from 0 to {most}, got {shown(part)}")
    return number
