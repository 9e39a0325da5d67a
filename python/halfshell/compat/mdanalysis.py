# SPDX-License-Identifier: BSD-3-Clause
"""Drop-ins for `MDAnalysis.lib.distances`: pairs within a cutoff, in their nearest images.

As there, coordinates and box are float32, and a pair counts up to `max_cutoff` and beyond
`min_cutoff`. MDAnalysis compares rounded distances, and the rounding depends on its method; here
the exact values of the float32 numbers decide. The order of the pairs is not specified.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import numpy.typing as npt

try:
    from MDAnalysis.lib.mdamath import triclinic_vectors
    from MDAnalysis.lib.util import check_box, check_coords
except ImportError as error:  # pragma: no cover
    message = "halfshell.compat.mdanalysis needs MDAnalysis: pip install MDAnalysis"
    raise ImportError(message) from error

from halfshell._functions.between import pairs_between
from halfshell._functions.pairs import pairs
from halfshell._objects.box import Box

__all__ = ["capped_distance", "self_capped_distance"]

_METHODS = {"bruteforce", "nsgrid", "pkdtree"}
_ROUNDING = 2.0**-30  # far more than that of a height
Entries = tuple[npt.NDArray[Any], npt.NDArray[Any]]
_KEPT = {"enforce_copy": False, "reduce_result_if_single": False, "allow_atomgroup": True}


def _box(box: Any) -> npt.NDArray[np.float64] | None:
    """Box vectors in rows, or None for open space, which zeros mean too."""
    if box is None:
        return None
    check_box(box)
    lengths_and_angles = np.asarray(box, np.float32)
    if not lengths_and_angles.any():
        return None
    return np.asarray(triclinic_vectors(lengths_and_angles), np.float64)


def _check(method: str | None) -> None:
    if method is not None and method.lower() not in _METHODS:
        raise KeyError(method.lower())


def _nearest_images(
    entries: Entries, vectors: npt.NDArray[Any] | None, cutoff: float, selves: bool
) -> Entries:
    """Each pair once, with its least distance, where some have several images."""
    both, d = entries
    if vectors is None:
        return both, d
    least = Box.from_matrix(vectors).perpendicular_heights.min() * (1.0 - _ROUNDING)
    if 2.0 * cutoff < least:
        return both, d
    order = np.lexsort((d, both[:, 1], both[:, 0]))
    both, d = both[order], d[order]
    first = np.ones(len(d), np.bool_)
    first[1:] = (both[1:] != both[:-1]).any(axis=1)
    if selves:
        first &= both[:, 0] != both[:, 1]
    return both[first], d[first]


def _answer(entries: Entries, min_cutoff: float | None, distances: bool) -> Any:
    both, d = entries
    if min_cutoff is not None:
        beyond = d > min_cutoff
        both, d = both[beyond], d[beyond]
    both = both.astype(np.intp, copy=False)
    return (both, d) if distances else both


@check_coords("reference", "configuration", check_lengths_match=False, **_KEPT)
def capped_distance(
    reference: Any,
    configuration: Any,
    max_cutoff: float,
    min_cutoff: float | None = None,
    box: Any = None,
    method: str | None = None,
    return_distances: bool = True,
    backend: str = "serial",
) -> Any:
    """Pairs of two sets within a cutoff, as `MDAnalysis.lib.distances.capped_distance`.

    Parameters
    ----------
    reference, configuration : (n, 3) or (3,) array_like, or AtomGroup
        Read as float32.
    max_cutoff : float
        Pairs at this distance count.
    min_cutoff : float, optional
        Pairs at this distance, or nearer, do not.
    box : (6,) array_like, optional
        Lengths and angles in degrees. None, or zeros: open space.
    method, backend : str, optional
        Checked, where they are names of methods, and not used.
    return_distances : bool, default True

    Returns
    -------
    pairs : ndarray of intp, shape (m, 2)
        Indices in `reference` and in `configuration`.
    distances : ndarray of float64, shape (m,)
        In the nearest image, within 1 ulp; if wanted.

    Raises
    ------
    ValueError, TypeError, KeyError
        As the original, for a box, coordinates or a method that are none; ValueError for NaN.

    Examples
    --------
    >>> from halfshell.compat.mdanalysis import capped_distance
    >>> import numpy as np
    >>> queries = np.array([[0.5, 0.0, 0.0]], np.float32)
    >>> points = np.array([[9.5, 0.0, 0.0], [5.0, 0.0, 0.0]], np.float32)
    >>> pairs, d = capped_distance(queries, points, 2.0, box=[10, 10, 10, 90, 90, 90])
    >>> pairs.tolist(), d.tolist()
    ([[0, 0]], [1.0])
    """
    _check(method)
    vectors = _box(box)
    if not len(reference) or not len(configuration) or max_cutoff < 0.0:
        return _answer((np.empty((0, 2), np.intp), np.empty(0)), None, return_distances)
    found = pairs_between(reference, configuration, max_cutoff, box=vectors, quantities="Pd")
    nearest = _nearest_images(cast("Entries", found), vectors, max_cutoff, False)
    return _answer(nearest, min_cutoff, return_distances)


@check_coords("reference", **_KEPT)
def self_capped_distance(
    reference: Any,
    max_cutoff: float,
    min_cutoff: float | None = None,
    box: Any = None,
    method: str | None = None,
    return_distances: bool = True,
    backend: str = "serial",
) -> Any:
    """Pairs of one set within a cutoff, as `MDAnalysis.lib.distances.self_capped_distance`.

    Parameters
    ----------
    reference : (n, 3) array_like or AtomGroup
        Read as float32.
    max_cutoff, min_cutoff, box, method, return_distances, backend
        As in `capped_distance`.

    Returns
    -------
    pairs : ndarray of intp, shape (m, 2)
        Indices, the lower one first.
    distances : ndarray of float64, shape (m,)
        In the nearest image, within 1 ulp; if wanted.

    Raises
    ------
    ValueError, TypeError, KeyError
        As `capped_distance`.

    Examples
    --------
    >>> from halfshell.compat.mdanalysis import self_capped_distance
    >>> import numpy as np
    >>> points = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [0.0, 0.0, 9.5]], np.float32)
    >>> pairs, d = self_capped_distance(points, 5.0)
    >>> pairs.tolist(), d.tolist()
    ([[0, 1]], [5.0])
    """
    _check(method)
    vectors = _box(box)
    if not len(reference) or max_cutoff < 0.0:
        return _answer((np.empty((0, 2), np.intp), np.empty(0)), None, return_distances)
    found = pairs(reference, max_cutoff, box=vectors, quantities="Pd")
    nearest = _nearest_images(cast("Entries", found), vectors, max_cutoff, True)
    return _answer(nearest, min_cutoff, return_distances)
