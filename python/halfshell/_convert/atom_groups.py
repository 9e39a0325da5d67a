# SPDX-License-Identifier: BSD-3-Clause
"""Universes and groups of atoms of MDAnalysis, told by their attributes: it is not imported.

Their box is that of the present frame, as vectors. They do not say which axes repeat.
"""

from __future__ import annotations

from typing import Any

from halfshell._convert.foreign import attribute

_MISSING = object()


def is_group(values: Any, name: str) -> bool:
    """Whether it is a universe, or a group of its atoms, with positions."""
    universe = attribute(values, "universe", name, _MISSING)
    atoms = attribute(values, "atoms", name, _MISSING)
    if universe is _MISSING or atoms is _MISSING:
        return False
    owner = atoms if universe is values else values
    return attribute(owner, "positions", name, _MISSING) is not _MISSING


def of_group(values: Any, name: str) -> tuple[Any, Any]:
    """Positions, and box vectors or None."""
    universe = attribute(values, "universe", name)
    atoms = attribute(values, "atoms", name)
    frame = attribute(attribute(universe, "trajectory", name), "ts", name)
    positions = attribute(atoms if universe is values else values, "positions", name)
    return positions, attribute(frame, "triclinic_dimensions", "box")


def elements_of(values: Any, name: str) -> Any:
    """The symbol of each atom, or None if these are not known."""
    return attribute(attribute(values, "atoms", name), "elements", name)
