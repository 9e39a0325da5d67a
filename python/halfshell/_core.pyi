# SPDX-License-Identifier: BSD-3-Clause
from collections.abc import Callable
from typing import Any, type_check_only

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]
_Arrays = npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]

# Every search begins with ten arguments: points (or cells of cells_build, with None and 0 as the
# next two), cutoff, box, periodic, inclusive, precision, kernel, memory_limit, progress, threads.
_Search = tuple[
    Any, float, _Floats | None, int, bool, str, str | None, float | None,
    Callable[[float], object] | None, int | None,
]  # fmt: skip
_Queries = npt.NDArray[Any] | None
# Functions that find pairs end with a reach for each: the number of a rule (sum, mean, max, min,
# gather, scatter), radii of points and queries, types of both and a table of cutoffs by types, of
# which a negative one is none, supports of points and queries and their extent, which is how many
# times radii count where there are none; or None where all pairs have the cutoff. The name of an
# algorithm comes last. A tuple of a reach or None and a selection may stand in its place.
_Ints = npt.NDArray[np.int32] | None
_Reach = tuple[
    int, _Floats | None, _Floats | None, _Ints, _Ints, _Floats | None,
    _Floats | None, _Floats | None, float | None,
] | None  # fmt: skip
# Functions that return arrays go on with quantities, sort, index_bytes, out.
_Result = tuple[str, bool, int, Any]
# Many systems: batch, cutoffs, boxes, the batch of queries, and bits of the axes that repeat; all
# but the first may be None. Functions that take them as one tuple have it at their very end.
_Batch = tuple[
    npt.NDArray[np.int64], _Floats | None, _Floats | None, npt.NDArray[np.int64] | None,
    npt.NDArray[np.uint8] | None,
]  # fmt: skip
# Functions that find pairs may have a capacity at their very end, negative where the number of
# pairs is returned as well.
_Room = tuple[int | None, ...]
_Last = tuple[_Batch | None, ...]

def pairs(
    *arguments: *tuple[*_Search, *_Result, _Reach, str, _Floats | None, *_Room]
) -> _Arrays: ...
def count_pairs(*arguments: *tuple[*_Search, _Reach, str]) -> int: ...
def pairs_between(
    *arguments: *tuple[*_Search, *_Result, _Queries, _Reach, str, *tuple[Any, ...]]
) -> _Arrays: ...
def count_between(*arguments: *tuple[*_Search, _Queries, _Reach, str]) -> int: ...
def coordination(
    *arguments: *tuple[*_Search, _Queries, _Reach, str, *_Last]
) -> npt.NDArray[np.int64]: ...
def batch_pairs(
    *arguments: *tuple[*_Search, *_Result, *_Batch, _Reach, str, *_Room]
) -> _Arrays: ...
def batch_count(*arguments: *tuple[*_Search, *_Batch, _Reach, str]) -> npt.NDArray[np.int64]: ...

# quantities, index_bytes, queries -> offsets first
def neighbors(
    *arguments: *tuple[*_Search, str, int, _Queries, _Reach, str, *_Last]
) -> tuple[npt.NDArray[Any], ...]: ...

# quantities, index_bytes, max_pairs; last the cutoffs of shells -> a PairBlocks
def iter_pairs(*arguments: *tuple[*_Search, str, int, int, _Reach, str, _Floats | None]) -> Any: ...

# callback, user_data, thread_safe
def for_each_pair(
    *arguments: *tuple[*_Search, Callable[..., object] | int, int, bool, _Reach, str]
) -> int: ...

# core points or None, winding -> number of clusters, labels, bits of winding or None
def clusters(
    *arguments: *tuple[*_Search, npt.NDArray[np.bool_] | None, bool, _Reach, str]
) -> tuple[int, npt.NDArray[np.int64], npt.NDArray[np.uint8] | None]: ...

# edges, last_inclusive, queries, n_types; types and weights of the points, then of the queries
def histogram(
    *arguments: *tuple[
        *_Search, _Floats, bool, _Queries, int,
        npt.NDArray[np.int32] | None, _Floats | None, npt.NDArray[np.int32] | None, _Floats | None,
        str, *tuple[Any, ...],
    ]
) -> npt.NDArray[Any]: ...  # fmt: skip

# i, j, shifts of a half list; n_nodes, n_ghosts, number of all nodes, flags -> (rows, (nodes of
# pairs, their lists)), or (rows, None)
_Counts = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], _Ints, int]

def connect(
    *arguments: *tuple[
        *_Search, npt.NDArray[np.int32], npt.NDArray[np.int32], _Ints, *_Counts
    ]
) -> Any: ...

def connect_search(*arguments: *tuple[*_Search, *_Counts, _Reach]) -> Any: ...

# offsets, indices of rows -> those of their product
def overlap(
    *arguments: *tuple[*_Search, npt.NDArray[np.int64], npt.NDArray[np.int32], *_Counts]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]: ...

# i, j of a half list
def intersect(
    *arguments: *tuple[*_Search, npt.NDArray[np.int32], npt.NDArray[np.int32], *_Counts]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]: ...

# offsets, indices, shifts of rows
_Rows = tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], _Ints]
_Columns = tuple[
    npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32]
]
_Change = tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]  # n_nodes, target

def pair_rows(*arguments: *tuple[*_Search, *_Rows, *_Counts]) -> Any: ...

# place, source
def keep_rows(
    *arguments: *tuple[*_Search, *_Rows, *_Change, _Ints, npt.NDArray[np.int64] | None]
) -> Any: ...

# the number of lists, whether rows ascend
def rows_without(*arguments: *tuple[*_Search, *_Rows, *_Rows, int, bool]) -> Any: ...

# columns, shifts; keep
def keep_pairs(
    *arguments: *tuple[
        *_Search, *_Columns, _Ints, npt.NDArray[np.int64] | None, npt.NDArray[np.int32] | None,
        npt.NDArray[np.bool_] | None,
    ]
) -> Any: ...
def feet_between(points: _Floats, p: _Floats, q: _Floats, /) -> npt.NDArray[np.bool_]: ...
def morton_keys(points: _Floats, low: _Floats, high: _Floats, /) -> npt.NDArray[np.uint64]: ...

# quantities, sort, index_bytes, measure
def explain(*arguments: *tuple[*_Search, str, bool, int, bool, _Reach, str]) -> dict[str, Any]: ...

# One of the functions above, called with arguments as users give them, with periodic in place of
# bits, index_dtype in place of index_bytes and no reach. What needs a conversion is answered with
# NotImplemented.
def plain(function: Callable[..., Any], /, *arguments: Any) -> Any: ...
def quick(
    function: Callable[..., Any],
    usual: tuple[Any, ...],
    places: dict[str, int],
    points: Any,
    cutoff: Any,
    options: dict[str, Any],
    /,
) -> Any: ...

# cell_size, or 0 -> a capsule
def cells_build(*arguments: *tuple[*_Search, float]) -> Any: ...
def cells_layout(cells: Any, /) -> dict[str, Any]: ...
def cells_find(cells: Any, points: npt.NDArray[Any], /) -> npt.NDArray[np.int64]: ...
def cells_candidates(
    *arguments: *tuple[*_Search, _Queries]
) -> tuple[npt.NDArray[np.int64], ...]: ...
# quantities, index_bytes, queries, k; the cutoff is the largest distance

# quantities, i, j, S
def measure(
    *arguments: *tuple[
        *_Search, str, npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64] | None
    ]
) -> _Arrays: ...
def nearest(*arguments: *tuple[*_Search, str, int, _Queries, int, *_Last]) -> _Arrays: ...
def verlet_new() -> Any: ...  # a capsule, which comes before the arguments of a search

# skin, rebuild
def verlet_update(*arguments: *tuple[Any, *_Search, float, bool]) -> bool: ...
def verlet_pairs(*arguments: *tuple[Any, *_Search, *_Result]) -> _Arrays: ...
def verlet_look(list: Any, /) -> dict[str, Any]: ...
# dim, cell_size, box, periodic bits, storage (a number), max_radius or 0, inclusive, tagged, and
# what makes an array of a position
def dynamic_new(
    *arguments: *tuple[
        int, float, _Floats | None, int, int, float, bool, bool, Callable[[Any, int], _Floats]
    ]
) -> DynamicCells: ...

@type_check_only
class DynamicCells:
    def insert(self, key: Any, position: Any, /) -> None: ...
    def move(self, key: Any, position: Any, /) -> None: ...
    def remove(self, key: Any, /) -> bool: ...
    def has(self, key: Any, /) -> bool: ...
    def position(self, key: Any, /) -> _Floats: ...
    def cell(self, key: Any, /) -> tuple[int, ...]: ...
    def any_within(self, position: Any, radius: Any, skip: Any, /) -> bool: ...
    def near(self, position: Any, radius: Any, /) -> npt.NDArray[np.int64]: ...
    def within(self, position: Any, radius: Any, with_shift: bool, /) -> Any: ...
    def within_many(
        self, positions: _Floats, radius: Any, with_shift: bool, /
    ) -> tuple[npt.NDArray[np.int64], Any]: ...
    def insert_many(
        self, ids: npt.NDArray[np.int64], tags: _Ints, positions: npt.NDArray[Any], /
    ) -> None: ...
    def move_many(
        self, ids: npt.NDArray[np.int64], tags: _Ints, positions: npt.NDArray[Any], /
    ) -> None: ...
    def remove_many(self, ids: npt.NDArray[np.int64], tags: _Ints, /) -> npt.NDArray[np.bool_]: ...
    def keys(self, cursor: int, most: int, /) -> tuple[int, npt.NDArray[np.int64]]: ...
    def positions(self, keys: npt.NDArray[np.int64], /) -> _Floats: ...
    def clear(self) -> None: ...
    def shrink_to_fit(self) -> None: ...
    def copy(self) -> DynamicCells: ...
    def look(self) -> dict[str, Any]: ...
    def changes(self) -> int: ...
    def __len__(self) -> int: ...
    def __contains__(self, key: Any, /) -> bool: ...

def kernels() -> tuple[str, ...]: ...
def default_kernel() -> str: ...
_C_API: Any  # a PyCapsule; see csrc/halfshell_capi.h

def build_info() -> dict[str, Any]: ...
def available_memory() -> float: ...
def group_memory(root: str, /) -> float: ...
def box_measure(box: _Floats, periodic: int, /) -> tuple[_Floats, float]: ...
def box_wrap(
    points: npt.NDArray[Any], box: _Floats, periodic: int, /
) -> tuple[_Floats, npt.NDArray[np.int64]]: ...
def box_places(
    points: npt.NDArray[Any], box: _Floats | None, periodic: int, cutoff: float, largest: float, /
) -> tuple[_Floats, tuple[bool, ...], tuple[float, ...], tuple[float, ...]]: ...
def clear_cache() -> None: ...
def set_cache_limit(bytes: int, /) -> int: ...
def cache_limit() -> int: ...
def cache_held() -> int: ...
