# SPDX-License-Identifier: BSD-3-Clause
"""`PairField`: numbers for each pair of a table, for as long as that is the present one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.foreign import is_a, kind_of, shown
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_count
from halfshell._errors import StaleError
from halfshell._objects.pair_table import Pair, PairTable


def _as_dtype(value: Any) -> np.dtype[Any]:
    try:
        dtype: np.dtype[Any] = np.dtype(value)
        return dtype
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(f"dtype must be one of NumPy's, got {shown(value)}") from error


class PairField:
    """One value, or several, for each pair of a `PairTable`.

    Parameters
    ----------
    pairs : PairTable
        The pairs of a connectivity.
    dtype : dtype_like, default numpy.float64
        Type of the values.
    n_elements : int, default 1
        Values for each pair.

    Attributes
    ----------
    values : ndarray of `dtype`, shape (m,), or (m, n_elements) if there are several
        All values, zero at first; can be written to.
    pairs : PairTable

    Raises
    ------
    StaleError
        On every access after the connectivity has been rebuilt or patched, or pairs have been
        removed. An array taken from `values` before that is a plain NumPy array, and stays.

    Notes
    -----
    ``field[k]`` is the value of pair k, or its row of values; ``field[i_node, i_list, j_node,
    j_list]`` that of a pair, as `PairTable.index` finds it. Slices, masks and arrays of numbers
    select as they do in ``values``. All of them can be assigned to.

    Examples
    --------
    >>> import halfshell as hs
    >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
    >>> force = hs.PairField(c.pairs)
    >>> force[0, 0, 1, 0] = 2.5
    >>> force[1, 0, 0, 0], force[0], force.values.tolist()
    (np.float64(2.5), np.float64(2.5), [2.5, 0.0])
    """

    __slots__ = ("_pairs", "_values", "n_elements")

    def __init__(
        self, pairs: PairTable, dtype: npt.DTypeLike = np.float64, n_elements: int = 1
    ) -> None:
        if not is_a(pairs, PairTable):
            raise TypeError(f"pairs must be a PairTable, got {kind_of(pairs)}")
        self.n_elements = as_count(n_elements, "n_elements")
        self._pairs = pairs
        self._refuse_stale()
        refuse_unavailable(
            len(pairs) * self.n_elements, f"values with n_elements = {shown(n_elements)}"
        )
        shape = (len(pairs),) if self.n_elements == 1 else (len(pairs), self.n_elements)
        self._values: npt.NDArray[Any] = np.zeros(shape, _as_dtype(dtype))

    @property
    def values(self) -> npt.NDArray[Any]:
        self._refuse_stale()
        return self._values

    @property
    def pairs(self) -> PairTable:
        self._refuse_stale()
        return self._pairs

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.values)

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        state = ", stale: its pairs are no more" if self._pairs._outdated else ""
        return f"PairField({len(self._values)} x {self.n_elements} {self._values.dtype}{state})"

    def __getitem__(self, key: Any) -> Any:
        return self.values[self._place(key)]

    def __setitem__(self, key: Any, value: Any) -> None:
        self.values[self._place(key)] = value

    def zero(self) -> None:
        """Set all values to zero."""
        self.values[...] = 0

    def copy(self) -> PairField:
        """Another field of these pairs, with the same values."""
        other = PairField(self.pairs, self._values.dtype, self.n_elements)
        other._values[...] = self._values
        return other

    def _place(self, key: Any) -> Any:
        if is_a(key, Pair) or (is_a(key, tuple) and len(key) == 4):
            return self._pairs.index(key)
        return key

    def _refuse_stale(self) -> None:
        if self._pairs._outdated is not None:
            raise StaleError(
                f"this field belongs to pairs before {self._pairs._outdated}(): "
                "make a new PairField of Connectivity.pairs"
            )
