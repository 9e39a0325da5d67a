# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs count: groups, excluded pairs and a least distance, as the core takes them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array, one_each
from halfshell._convert.foreign import is_a, kind_of, whole_number
from halfshell._convert.lengths import as_number
from halfshell._convert.listed import as_point_numbers
from halfshell._errors import shorten

if TYPE_CHECKING:
    from halfshell._convert.given import Chosen
    from halfshell._convert.types import Reach, Selection

_Labels = npt.NDArray[np.int64]

_QUERY_NUMBERS = 4  # which field of a selection these are


def with_selection(
    reach: Any, chosen: Chosen, n: int, q: int | None, precision: Any = "exact"
) -> Reach | None:
    """The reach, and what is chosen among n points, or among these for each of q queries."""
    if chosen.is_nothing:
        return None if reach is None else reach
    try:
        selection = _as_selection(chosen, n, q)
    except Exception as error:
        shorten(error)
        raise
    if selection[-1] > 0.0 and is_a(precision, str) and precision == "single":
        raise ValueError("min_distance cannot be combined with precision 'single'")
    return (reach, selection)  # type: ignore[return-value]


def reach_of(reach: Any) -> Reach | None:
    """The reach alone, of that or of one with a selection."""
    found: Reach | None = reach[0] if reach is not None and len(reach) == 2 else reach
    return found


def for_points(reach: Any, by: Reach | None, numbers: _Labels) -> Reach | None:
    """With the reach `by`, the selection of a search whose queries are these of the points."""
    if reach is None or len(reach) != 2:
        return by
    fields = list(reach[1])
    fields[_QUERY_NUMBERS] = numbers
    return (by, tuple(fields))  # type: ignore[return-value]


def _as_selection(chosen: Chosen, n: int, q: int | None) -> Selection:
    groups, asking_groups = _both(chosen.groups, chosen.query_groups, "groups", n, q)
    excluded = _as_pairs(chosen.exclude, n, q)
    labels = asking_labels = None
    if excluded is None:
        named = chosen.exclude_within is None
        labels, asking_labels = _both(
            chosen.exclude, chosen.query_exclude, "exclude", n, q, may_be_names=named
        )
    elif chosen.query_exclude is not None:
        raise ValueError("query_exclude needs labels in exclude, not pairs of numbers")
    within = _as_within(chosen.exclude_within, labels is not None)
    least = _as_least(chosen.min_distance)
    return groups, asking_groups, labels, asking_labels, None, within, excluded, least


def _both(
    own: Any, asking: Any, name: str, n: int, q: int | None, may_be_names: bool = True
) -> tuple[_Labels | None, _Labels | None]:
    """Labels of points and queries, of which both have some or neither has."""
    if q is None and asking is not None:
        raise ValueError(f"query_{name} needs queries")
    if q is not None and (own is None) != (asking is None):
        raise ValueError(f"with queries, {name} and query_{name} must be given together")
    if own is None:
        return None, None
    labels = _as_labels(own, name, n, may_be_names)
    others = None if q is None else _as_labels(asking, f"query_{name}", q, may_be_names)
    kinds = {array.dtype.kind for array in (labels, others) if array is not None and array.size}
    if kinds == {"U", "i"}:
        raise TypeError(f"{name} and query_{name} must both be numbers or both be names")
    if "U" not in kinds:
        return labels.astype(np.int64), None if others is None else others.astype(np.int64)
    # Names are numbered: the same name has the same number in both.
    together = [array.astype(np.str_) for array in (labels, others) if array is not None]
    numbers = np.unique(np.concatenate(together), return_inverse=True)[1].astype(np.int64)
    return numbers[: len(labels)].copy(), None if others is None else numbers[len(labels) :].copy()


def _as_labels(values: Any, name: str, n: int, may_be_names: bool) -> npt.NDArray[Any]:
    """Whole numbers as int64, or names."""
    kinds = "integers or names" if may_be_names else "integers"
    array = as_array(values, name, f"hold {kinds}")
    if array.dtype.kind == "T" or (
        array.dtype.kind == "O" and array.ndim == 1 and all(is_a(one, str) for one in array)
    ):
        array = array.astype(np.str_)
    one_each(name, n)(array.shape)
    if array.dtype.kind == "U" and may_be_names:
        return array
    if array.dtype.kind not in "iu" and n > 0:
        raise TypeError(f"{name} must hold {kinds}, got dtype {array.dtype}")
    if array.dtype == np.uint64:
        for k in np.flatnonzero(array >= np.uint64(2**63)):
            raise ValueError(f"{name} must be less than 2**63, got {name}[{k}] = {array[k]}")
    return np.ascontiguousarray(array, np.int64)


def _as_pairs(exclude: Any, n: int, q: int | None) -> npt.NDArray[np.int64] | None:
    """Numbers of points, (k, 2), or None for labels."""
    if exclude is None:
        return None
    array = as_array(exclude, "exclude", "hold integers")
    if array.shape == (2,) and n != 2:
        raise ValueError(
            f"exclude must have shape (k, 2), pairs of numbers, or ({n},), labels, got (2,): "
            "one pair is [[i, j]]"
        )
    if array.ndim < 2 and not (array.size == 0 and n > 0):
        return None
    if array.ndim < 2:
        array = np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(
            f"exclude must have shape (k, 2), pairs of numbers, or ({n},), labels, "
            f"got {array.shape}"
        )
    asking, numbered = (n, "points") if q is None else (q, "queries")
    first = as_point_numbers(array[:, 0], "exclude[:, 0]", asking, numbered)
    second = as_point_numbers(array[:, 1], "exclude[:, 1]", n, "points")
    return np.ascontiguousarray(np.stack([first, second], axis=1))


def _as_within(value: Any, has_labels: bool) -> int:
    if value is None:
        return 0
    within = whole_number(value, "exclude_within")
    if within is None:
        raise TypeError(f"exclude_within must be a whole number, got {kind_of(value)}")
    if not has_labels:
        raise ValueError("exclude_within needs labels in exclude, one for each point")
    if not 0 <= within < 2**63:
        raise ValueError(f"exclude_within must be from 0 on and below 2**63, got {within}")
    return within


def _as_least(value: Any) -> float:
    if value is None:
        return 0.0
    least = as_number(value, "min_distance")
    if not (math.isfinite(least) and least >= 0.0):
        raise ValueError(f"min_distance must be finite and not negative, got {least}")
    return least
