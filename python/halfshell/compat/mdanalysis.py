# SPDX-License-Identifier: BSD-3-Clause
"""Drop-ins for `MDAnalysis.lib.distances`: pairs within a cutoff, in their nearest images.

As there, coordinates and box are float32, and a pair counts up to `max_cutoff` and beyond
`min_cutoff`. MDAnalysis compares rounded distances, and the rounding depends on its method; here
the exact values of the float32 numbers decide. The order of the pairs is not specified.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from MDAnalysis.lib.util import check_box, check_coords

import halfshell as hs
from halfshell import _core

__all__ = ["capped_distance", "self_capped_distance"]

_METHODS = {"bruteforce", "nsgrid", "pkdtree"}
_BACKENDS = ("serial", "openmp", "distopia")
Entries = tuple[npt.NDArray[Any], npt.NDArray[Any]]
_KEPT = {"enforce_copy": False, "reduce_result_if_single": False, "allow_atomgroup": True}


#: Axes that are not longer are open in MDAnalysis.
_SHORTEST = float(np.finfo(np.float32).eps)
_OPEN: dict[str, Any] = {"box": None}


def _box(box: Any) -> tuple[dict[str, Any], list[float]]:
    """Box and periodicity, and along each axis the length of a box with right angles or of a lower
    triangle; both open where MDAnalysis has it so."""
    if box is None:
        return _OPEN, [0.0] * 3
    kind, form = check_box(box)
    given = np.asarray(box, np.float32).reshape(-1)
    if math.isnan(given.dot(given)):
        raise ValueError(f"box must be lengths and angles, which NaN is not, got {box!r}")
    form = form.astype(np.float64)
    # Zeros, if no triclinic box is like it.
    lengths: list[float] = (form if kind == "ortho" else form.diagonal()).tolist()
    if min(lengths) > _SHORTEST:
        return {"box": form}, lengths
    periodic = np.array([length > _SHORTEST for length in lengths])
    if not periodic.any():
        return _OPEN, [0.0] * 3
    if kind == "ortho":
        form[~periodic] = 0.0
    return {"box": form, "periodic": periodic}, np.where(periodic, lengths, 0.0).tolist()


def _check(method: str | None, backend: str) -> None:
    if method is not None and method.lower() not in _METHODS:
        raise KeyError(method.lower())
    if backend.lower() not in _BACKENDS:
        raise ValueError(f"backend must be one of {_BACKENDS}, got {backend!r}")


def _within(max_cutoff: Any, lengths: list[float], *sets: Any) -> Any:
    """The cutoff, or if it is less a length that no nearest image exceeds.

    The vectors of the box are rows of a lower triangle, so some image of each point is as near as
    half of the diagonal is long; on open axes points are as far apart as their coordinates.
    """
    spans = [length / 2.0 for length in lengths]
    if math.isfinite(max_cutoff) and (max_cutoff <= max(spans) or not any(spans)):
        return max_cutoff
    if not all(spans):
        low = np.min([points.min(axis=0) for points in sets], axis=0).astype(np.float64)
        far = np.max([points.max(axis=0) for points in sets], axis=0) - low
        spans = [span or other for span, other in zip(spans, far.tolist())]
    most = math.hypot(*spans) * (1.0 + 1e-9)
    if not math.isfinite(most):
        return 0.0  # enough to find out which of the points is not finite
    return most if max_cutoff > most else max_cutoff


def _has_images(box: dict[str, Any], lengths: list[float], cutoff: float) -> bool:
    """Whether pairs may have several images within the cutoff."""
    if box["box"] is None:
        return False
    heights = lengths
    if box["box"].ndim == 2:
        whole = np.where(np.array(lengths) > 0.0, box["box"], np.eye(3))
        heights = hs.Box.from_matrix(whole).perpendicular_heights.tolist()
    nearest = min(height for height, length in zip(heights, lengths) if length)
    return bool(2.0 * cutoff >= nearest * (1.0 - 1e-9))  # which is rounded


def _nearest_images(i: Any, j: Any, d: Any, selves: bool) -> Entries:
    """Each pair once, with its least distance, of pairs that are sorted."""
    is_first = np.ones(len(d), bool)
    np.logical_or(i[1:] != i[:-1], j[1:] != j[:-1], out=is_first[1:])
    (first,) = is_first.nonzero()
    if len(first):
        i, j, d = i[first], j[first], np.minimum.reduceat(d, first)
    if selves:
        (kept,) = (i != j).nonzero()
        i, j, d = i[kept], j[kept], d[kept]
    both = np.empty((len(d), 2), np.intp)
    both[:, 0], both[:, 1] = i, j
    return both, d


def _of_few(sets: Any, cutoff: Any, box: Any) -> Entries | None:
    """Pairs of few points in their nearest images, without a search; None where there are more."""
    if len(sets[0]) * len(sets[-1]) > _core.FEW_PAIRS or (box is not None and box.ndim == 2):
        return None
    points = sets[-1].astype(np.float64)
    queries = sets[0].astype(np.float64) if len(sets) == 2 else None
    found: Entries | None = _core.few(points, queries, box, cutoff, 2, 0, "b")
    return found


def _answer(
    search: Any, max_cutoff: Any, min_cutoff: Any, given: Any, sets: Any, distances: bool
) -> Any:
    """Pairs that `search` finds in these sets, in the nearest image, beyond the lesser cutoff."""
    box, lengths = _box(given)
    if not len(sets[0]) or not len(sets[-1]) or max_cutoff < 0.0:
        entries: Entries | None = (np.empty((0, 2), np.intp), np.empty(0))
    else:
        entries = _of_few(sets, max_cutoff, box["box"])
    if entries is None:
        cutoff = _within(max_cutoff, lengths, *sets)
        is_one = len(sets) == 1
        if _has_images(box, lengths, cutoff):
            how = {"sort": True} if is_one else {}  # pairs of two sets are
            i, j, d = search(*sets, cutoff, quantities="ijd", **how, **box)
            entries = _nearest_images(i, j, d, is_one)
        else:
            entries = search(*sets, cutoff, quantities="Pd", **box)
    both, d = entries
    if min_cutoff is not None:
        kept = d > min_cutoff
        unsure = (abs(d - min_cutoff) <= 4.0 * np.spacing(d)) & (min_cutoff >= 0.0)  # d is rounded
        if unsure.any():
            near = search(*sets, min_cutoff, quantities="P", **box).astype(np.intp)
            width = len(sets[-1])
            number = both[unsure].astype(np.intp) @ (width, 1)
            kept[unsure] = ~np.isin(number, near @ (width, 1))
        both, d = both[kept], d[kept]
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
    """Pairs of two sets within a cutoff; see ``MDAnalysis.lib.distances.capped_distance``.

    `method` and `backend` are checked, and not used. Distances are float64, within 1 ulp.
    `max_cutoff` may be infinite, for all pairs. With right angles an axis is open if its length is
    zero or negative; if there is no such triclinic box, all are. ValueError also for NaN.

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
    _check(method, backend)
    sets = reference, configuration
    return _answer(hs.pairs_between, max_cutoff, min_cutoff, box, sets, return_distances)


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
    """Pairs of one set within a cutoff; see ``MDAnalysis.lib.distances.self_capped_distance``.

    What differs is as in `capped_distance`; the lower number of a pair comes first.

    Examples
    --------
    >>> from halfshell.compat.mdanalysis import self_capped_distance
    >>> import numpy as np
    >>> points = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [0.0, 0.0, 9.5]], np.float32)
    >>> pairs, d = self_capped_distance(points, 5.0)
    >>> pairs.tolist(), d.tolist()
    ([[0, 1]], [5.0])
    """
    _check(method, backend)
    if len(reference) < 2 and (box is None or np.shape(box) == (6,)):
        box = None  # there is no pair
    return _answer(hs.pairs, max_cutoff, min_cutoff, box, (reference,), return_distances)
