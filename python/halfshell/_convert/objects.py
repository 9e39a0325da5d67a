# SPDX-License-Identifier: BSD-3-Clause
"""What objects of other libraries know of their points: box, periodicity and elements.

None of these libraries is imported: an object is what its attributes say. ASE's Atoms, pymatgen's
Structure and Molecule, groups, universes and frames of MDAnalysis, frames of mdtraj, systems of
freud, and data frames with columns x, y, z.
"""

from __future__ import annotations

import sys
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from halfshell._convert.arrays import as_array, one_each
from halfshell._convert.foreign import attribute, kind_of, read

if TYPE_CHECKING:
    import numpy.typing as npt

# By atomic number; 0 stands for what is no element.
SYMBOLS = """
X H He Li Be B C N O F Ne Na Mg Al Si P S Cl Ar K Ca Sc Ti V Cr Mn Fe Co Ni Cu Zn Ga Ge As Se Br Kr
Rb Sr Y Zr Nb Mo Tc Ru Rh Pd Ag Cd In Sn Sb Te I Xe Cs Ba La Ce Pr Nd Pm Sm Eu Gd Tb Dy Ho Er Tm Yb
Lu Hf Ta W Re Os Ir Pt Au Hg Tl Pb Bi Po At Rn Fr Ra Ac Th Pa U Np Pu Am Cm Bk Cf Es Fm Md No Lr Rf
Db Sg Bh Hs Mt Ds Rg Cn Nh Fl Mc Lv Ts Og
""".split()

MISSING = object()

# Columns of a data frame that say what a point is, the first of these that is there.
_TYPE_COLUMNS = ("element", "symbol", "species", "type", "types")


class Parts(NamedTuple):
    """What an object knows; None for what it does not."""

    positions: Any
    box: Any = None
    periodic: Any = None  # None with a box: it does not say which axes repeat
    types: Any = None  # symbols or other names
    numbers: Any = None  # those of elements, which as_elements looks at where they count


def parts_of(values: Any, name: str) -> Parts | None:
    """The parts of an object; None for what is an array, or will be one."""
    if type(values) in (np.ndarray, list, tuple):
        return None

    def has(*attributes: str) -> bool:
        for one in attributes:
            if attribute(values, one, name, MISSING) is MISSING:
                return False
        return True

    if has("positions", "cell", "pbc"):
        return _of_atoms(values, name)
    if has("cart_coords"):
        return _of_pymatgen(values, name)
    if has("universe", "atoms"):
        return _of_group(values, name)
    if has("xyz", "unitcell_vectors"):
        return _of_mdtraj(values, name)
    if has("positions", "triclinic_dimensions"):
        rows = without_placeholder(values.triclinic_dimensions, name)
        return Parts(values.positions, rows)
    if has("points", "box") and callable(attribute(values.box, "to_matrix", name)):
        return Parts(values.points, values.box, _freud_periodic(values.box, 3))
    if has("columns", "to_numpy"):
        return _of_frame(values, name)
    return None


def _of_atoms(atoms: Any, name: str) -> Parts:
    cell, periodic = attribute(atoms, "cell", "box"), attribute(atoms, "pbc", "periodic")
    rows = attribute(cell, "array", "box")  # of a Cell of ASE
    cell = rows if type(rows) is np.ndarray else cell
    return Parts(atoms.positions, cell, periodic, *_elements(atoms, name))


def _of_pymatgen(structure: Any, name: str) -> Parts:
    """A Structure, or a Molecule, which has no lattice."""
    lattice = attribute(structure, "lattice", "box")
    elements = _elements(structure, name)
    if lattice is None:
        return Parts(structure.cart_coords, None, None, *elements)
    periodic = attribute(lattice, "pbc", "periodic")
    rows = attribute(lattice, "matrix", "box")
    return Parts(structure.cart_coords, rows, True if periodic is None else periodic, *elements)


def _of_group(values: Any, name: str) -> Parts | None:
    """A universe of MDAnalysis or a group of its atoms, with the box of the present frame."""
    universe, atoms = values.universe, values.atoms
    owner = atoms if universe is values else values
    positions = attribute(owner, "positions", name, MISSING)
    if positions is MISSING:
        return None
    frame = attribute(attribute(universe, "trajectory", name), "ts", name)
    rows = without_placeholder(attribute(frame, "triclinic_dimensions", "box"), name)
    elements = attribute(atoms, "elements", name)
    return Parts(positions, rows, None, elements)


def _of_mdtraj(frame: Any, name: str) -> Parts:
    """A Trajectory of one frame."""
    if len(frame.xyz) != 1:
        raise ValueError(
            f"{name} must be one frame, got a {kind_of(frame)} of {len(frame.xyz)}: "
            "trajectory_pairs takes them all"
        )
    rows = frame.unitcell_vectors
    rows = None if rows is None else without_placeholder(rows[0], name)
    atoms = attribute(attribute(frame, "topology", name), "atoms", name)
    symbols = None
    if atoms is not None:
        elements = [attribute(atom, "element", name) for atom in atoms]
        if elements and None not in elements:
            symbols = [attribute(element, "symbol", name) for element in elements]
    return Parts(frame.xyz[0], rows, None, symbols)


def _of_frame(table: Any, name: str) -> Parts | None:
    """A data frame of pandas or polars: its columns x, y, z, or all where it has none of them."""
    columns = {str(column).lower(): column for column in table.columns}
    every = [str(column) for column in table.columns]
    for column in set(every) & {*"xyzXYZ"}:
        if every.count(column) > 1:
            raise ValueError(f"{name} must have one column {column}, got {every.count(column)}")
    axes = [columns[axis] for axis in "xyz" if axis in columns]
    if axes and "x" not in columns:
        raise ValueError(
            f"{name} must have a column x beside {axes[0]}, got {', '.join(columns)}: "
            "name the columns x, y, z, or give those that are coordinates as an array"
        )
    if not axes:
        return None
    of_type = next((columns[one] for one in _TYPE_COLUMNS if one in columns), None)
    types = None if of_type is None else as_array(table[of_type], "types", "hold names")
    return Parts(as_array(table[axes], name), types=types)


def _elements(owner: Any, name: str) -> tuple[Any, Any]:
    """Names, or None, and atomic numbers, or None."""
    numbers = attribute(owner, "numbers", name)
    if numbers is None:
        numbers = attribute(owner, "atomic_numbers", name)  # of pymatgen
    if numbers is not None:
        return None, numbers
    symbols = attribute(owner, "get_chemical_symbols", name)
    if symbols is None:
        return None, None
    return read(name, owner, symbols, ".get_chemical_symbols"), None


def as_elements(values: Any, name: str, n: int) -> npt.NDArray[np.int32]:
    """Atomic numbers of n points."""
    array = as_array(values, name, "hold integers").copy()  # it may change
    one_each(name, n)(array.shape)
    if array.dtype.kind not in "iu" and array.size:
        raise TypeError(f"{name} must hold integers, got dtype {array.dtype}")
    for k in np.flatnonzero((array < 0) | (array >= len(SYMBOLS))):
        raise ValueError(
            f"{name} must be below {len(SYMBOLS)}, got numbers[{k}] = {array[k]}"
        )
    return array.astype(np.int32)


# ---- boxes ---------------------------------------------------------------------------------

def vectors_of(values: Any, name: str = "box", ndim: int | None = None) -> Any:
    """The vectors of a Box, or of another object that has some, as rows; else the object itself.

    A flat box is one of two dimensions where these are so many, else has a third vector of zeros.
    """
    if type(values) in (np.ndarray, list, tuple, float, int):
        return values
    vectors = attribute(values, "vectors", name, MISSING)
    if vectors is not MISSING:
        return vectors
    if callable(attribute(values, "to_matrix", name)):  # freud has columns as vectors
        matrix = as_array(read(name, values, values.to_matrix, ".to_matrix"), name)
        rows = matrix.T if matrix.ndim == 2 else matrix
        return rows[:2, :2] if ndim == 2 and rows.shape == (3, 3) and _is_flat(values) else rows
    for source in ("unitcell_vectors", "triclinic_dimensions"):
        vectors = attribute(values, source, name, MISSING)
        if vectors is MISSING:
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


def periodic_of(box: Any, periodic: Any, ndim: int) -> Any:
    """What was given, or else what the box says of itself, if it does."""
    if periodic is not None or type(box) in (np.ndarray, list, tuple, float, int):
        return periodic
    return _freud_periodic(box, ndim)


def _is_flat(box: Any) -> bool:
    dimensions = attribute(box, "dimensions", "box")
    return isinstance(dimensions, int) and dimensions == 2


def _freud_periodic(box: Any, ndim: int) -> Any:
    if not callable(attribute(box, "to_matrix", "box")):
        return None
    flags = as_array(attribute(box, "periodic", "box"), "periodic")
    if flags.shape != (3,) or flags.dtype.kind != "b":
        return None
    flags = flags & [True, True, not _is_flat(box)]
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
