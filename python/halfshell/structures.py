# SPDX-License-Identifier: BSD-3-Clause
"""A measured crystal for examples: alpha-quartz, without any other package or file.

The same crystal ships as a CIF file, ``structures.ALPHA_QUARTZ_CIF``, for programs that read
such files.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfshell import _show

__all__ = ["ALPHA_QUARTZ_CIF", "Structure", "alpha_quartz"]


def __dir__() -> list[str]:
    return __all__


#: The unit cell (9 points) as a CIF file.
ALPHA_QUARTZ_CIF = Path(__file__).with_name("data") / "alpha_quartz.cif"

# Levien, Prewitt & Weidner (1980), at atmospheric pressure; lengths in angstrom, positions in
# units of the cell. The file ALPHA_QUARTZ_CIF says the same; a test compares the two.
_A, _C = 4.916, 5.4054
_SI_U = 0.4697
_O_XYZ = (0.4135, 0.2669, 0.1191)


@_show.shown
class Structure(NamedTuple):
    """Points with their box.

    Attributes
    ----------
    positions : ndarray of float64, shape (n, 3)
        Cartesian, in angstrom.
    box : ndarray of float64, shape (3, 3)
        Edge vectors as rows, in angstrom; all are periodic.
    species : ndarray of str, shape (n,)
        Chemical symbols.
    """

    positions: NDArray[np.float64]
    box: NDArray[np.float64]
    species: NDArray[np.str_]


def alpha_quartz(repeat: tuple[int, int, int] = (8, 8, 8)) -> Structure:
    """Build a block of alpha-quartz, SiO2.

    Parameters
    ----------
    repeat : (int, int, int), default (8, 8, 8)
        Unit cells along each axis; 9 points each, so 4608 points by default.

    Returns
    -------
    Structure
        The named tuple ``(positions, box, species)``; positions inside the box.

    Raises
    ------
    ValueError
        If `repeat` is not three positive integers.

    Notes
    -----
    Space group P3_2 21, a = 4.916, c = 5.4054 angstrom, room temperature and atmospheric
    pressure [1]_. Only additions and multiplications of one number at a time are used, so the
    positions are the same to the last bit on every machine.

    References
    ----------
    .. [1] Levien, L., Prewitt, C. T. and Weidner, D. J. (1980). Structure and elastic
       properties of quartz at pressure. American Mineralogist 65, 920-930.

    Examples
    --------
    >>> positions, box, species = alpha_quartz((1, 1, 1))
    >>> positions.shape, species.tolist()
    ((9, 3), ['Si', 'Si', 'Si', 'O', 'O', 'O', 'O', 'O', 'O'])
    >>> box.diagonal().round(3).tolist()
    [4.916, 4.257, 5.405]
    """
    counts = np.asarray(repeat)
    if counts.shape != (3,) or counts.dtype.kind not in "iu" or counts.min() < 1:
        raise ValueError(f"repeat is {repeat!r}; it must be three positive integers")
    sites = np.array(_unit_cell())
    cells = np.indices(tuple(counts)).reshape(3, -1).T
    u, v, w = (cells[:, None, :] + sites[None, :, :]).reshape(-1, 3).T
    half, height = _A / 2, _A * (math.sqrt(3) / 2)
    positions = np.stack([u * _A - v * half, v * height, w * _C], axis=1)
    box = np.array([[_A, 0.0, 0.0], [-half, height, 0.0], [0.0, 0.0, _C]]) * counts[:, None]
    return Structure(positions, box, np.tile(np.array(["Si"] * 3 + ["O"] * 6), len(cells)))


def _unit_cell() -> list[tuple[float, ...]]:
    """Return the nine sites, 3 Si then 6 O, as fractions of the cell in [0, 1)."""
    third = 1 / 3
    u, (x, y, z) = _SI_U, _O_XYZ
    silicon = [(u, 0.0, 0.0), (0.0, u, 2 * third), (-u, -u, third)]
    oxygen = [
        (x, y, z),
        (-y, x - y, 2 * third + z),
        (y - x, -x, third + z),
        (y, x, 2 * third - z),
        (x - y, -y, -z),
        (-x, y - x, third - z),
    ]
    return [tuple(value % 1.0 for value in site) for site in silicon + oxygen]
