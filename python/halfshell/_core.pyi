# SPDX-License-Identifier: BSD-3-Clause
from collections.abc import Callable
from typing import Any, type_check_only

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[Any]
_Arrays = _Array | tuple[_Array, ...]
_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int64]
_Types = npt.NDArray[np.int32] | None
# A reach for each pair: the number of a rule (sum, mean, max, min, gather, scatter), radii of
# points and queries, types of both and a table of cutoffs by types, of which a negative one is
# none, supports of points and queries and their extent, which is how many times radii count where
# there are none; or None where all pairs have the cutoff. A tuple of a reach or None and a
# selection may stand in its place.
_Reach = Any
# Many systems: batch, cutoffs, boxes, the batch of queries, and bits of the axes that repeat; all
# but the first may be None.
_Batch = tuple[_Ints, _Floats | None, _Floats | None, _Ints | None, npt.NDArray[np.uint8] | None]

# Cells of cells_build may stand in place of points, with None and 0 as the next two. periodic and
# flags are bits, index_dtype is a number of bytes. With a negative capacity the number of pairs is
# returned too. neighbors returns offsets first; clusters the number of clusters, labels, bits of
# winding; for_each_pair how many pairs, and whether the callback ended it; node lists rows, and
# (nodes of pairs, their lists).

# ---- written by tests/core_stub.py
def pairs(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_dtype: int,
    out: Any,
    reach: _Reach = ...,
    algorithm: str = ...,
    shells: _Floats | None = ...,
    capacity: int | None = ...,
    batch: _Batch | None = ...,
    /,
) -> _Arrays: ...
def count_pairs(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    reach: _Reach = ...,
    algorithm: str = ...,
    queries: _Array | None = ...,
    batch: _Batch | None = ...,
    /,
) -> int | _Ints: ...
def pairs_between(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_dtype: int,
    out: Any,
    queries: _Array | None,
    reach: _Reach = ...,
    algorithm: str = ...,
    shells: _Floats | None = ...,
    capacity: int | None = ...,
    batch: _Batch | None = ...,
    /,
) -> _Arrays: ...
def neighbors(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    index_dtype: int,
    queries: _Array | None = ...,
    reach: _Reach = ...,
    algorithm: str = ...,
    shells: _Floats | None = ...,
    batch: _Batch | None = ...,
    /,
) -> tuple[_Array, ...]: ...
def coordination(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    queries: _Array | None = ...,
    reach: _Reach = ...,
    algorithm: str = ...,
    batch: _Batch | None = ...,
    /,
) -> _Ints: ...
def nearest(
    points: Any,
    max_distance: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    index_dtype: int,
    queries: _Array | None,
    k: int,
    reach: _Reach = ...,
    batch: _Batch | None = ...,
    /,
) -> _Arrays: ...
def histogram(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    edges: _Floats,
    last_inclusive: bool,
    queries: _Array | None,
    n_types: int,
    types: _Types,
    weights: _Floats | None,
    query_types: _Types,
    query_weights: _Floats | None,
    algorithm: str = ...,
    reach: _Reach = ...,
    batch: _Batch | None = ...,
    /,
) -> _Array: ...
def clusters(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    core: npt.NDArray[np.bool_] | None,
    winding: bool,
    reach: _Reach = ...,
    algorithm: str = ...,
    /,
) -> tuple[int, _Ints, npt.NDArray[np.uint8] | None]: ...
def iter_pairs(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    index_dtype: int,
    max_pairs: int,
    reach: _Reach = ...,
    algorithm: str = ...,
    shells: _Floats | None = ...,
    /,
) -> Any: ...
def for_each_pair(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    callback: Callable[..., object] | int,
    user_data: int,
    thread_safe: bool,
    first: int,
    reach: _Reach = ...,
    algorithm: str = ...,
    /,
) -> tuple[int, int]: ...
def measure(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    i: Any,
    j: Any,
    S: Any,
    /,
) -> _Arrays: ...
def explain(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_dtype: int,
    measure: bool,
    reach: _Reach = ...,
    algorithm: str = ...,
    shells: _Floats | None = ...,
    /,
) -> dict[str, Any]: ...
def cells_build(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    cell_size: float,
    domain: _Floats | None,
    /,
) -> Any: ...
def cells_candidates(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    queries: _Array | None = ...,
    /,
) -> tuple[_Ints, ...]: ...
def verlet_update(
    list: Any,
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    skin: float,
    rebuild: bool,
    /,
) -> bool: ...
def verlet_pairs(
    list: Any,
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_dtype: int,
    out: Any,
    /,
) -> _Arrays: ...
def connect(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    i: Any,
    j: Any,
    shifts: Any,
    n_nodes: Any,
    n_ghosts: Any,
    number: Any,
    flags: Any,
    /,
) -> Any: ...
def connect_search(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    n_nodes: Any,
    n_ghosts: Any,
    number: Any,
    flags: Any,
    reach: _Reach = ...,
    /,
) -> Any: ...
def overlap(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    offsets: Any,
    indices: Any,
    shifts: Any,
    n_nodes: Any,
    n_ghosts: Any,
    number: Any,
    flags: Any,
    /,
) -> Any: ...
def intersect(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    i: Any,
    j: Any,
    shifts: Any,
    n_nodes: Any,
    n_ghosts: Any,
    number: Any,
    flags: Any,
    /,
) -> Any: ...
def pair_rows(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    offsets: Any,
    indices: Any,
    shifts: Any,
    n_nodes: Any,
    n_ghosts: Any,
    number: Any,
    flags: Any,
    /,
) -> Any: ...
def keep_rows(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    offsets: Any,
    indices: Any,
    shifts: Any,
    n_nodes: Any,
    target: Any,
    place: Any,
    source: Any,
    /,
) -> Any: ...
def rows_without(
    points: Any,
    cutoff: float,
    box: _Floats | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    offsets: Any,
    indices: Any,
    shifts: Any,
    offsets_without: Any,
    indices_without: Any,
    shifts_without: Any,
    n_lists: Any,
    ascends: Any,
    /,
) -> Any: ...

# ---- end of what is written

def feet_between(points: _Floats, p: _Floats, q: _Floats, /) -> npt.NDArray[np.bool_]: ...
def morton_keys(points: _Floats, low: _Floats, high: _Floats, /) -> npt.NDArray[np.uint64]: ...

# Public functions of arguments as users give them, and what needs more than C does:
# NotImplemented. See csrc/binding/quick.h.
def quick(name: str, /) -> Callable[[tuple[Any, ...], dict[str, Any]], Any]: ...
def scene(points: Any, queries: Any, box: Any, periodic: Any, /) -> Any: ...
def know(name: str, thing: Any, /) -> None: ...

# Arguments of the core: names, and whether they may be left out; of users: names, usual values as
# Python writes them, whether they are positional.
def table() -> dict[str, tuple[list[tuple[str, bool]], list[tuple[str, str | None, bool]]]]: ...
def cells_layout(cells: Any, /) -> dict[str, Any]: ...
def cells_find(cells: Any, points: _Array, /) -> _Ints: ...
def verlet_new() -> Any: ...  # a capsule, which comes before the arguments of a search
def verlet_look(list: Any, /) -> dict[str, Any]: ...

# dim, cell_size, box, periodic bits, storage (a number), max_radius or 0, inclusive, tagged, and
# what makes an array of a position
def dynamic_new(
    *arguments: *tuple[
        int, float, _Floats | None, int, int, float, bool, bool, Callable[[Any, int], _Floats]
    ],
) -> DynamicCells: ...

@type_check_only
class DynamicCells:
    def insert(self, key: Any, position: Any, /) -> None: ...
    def move(self, key: Any, position: Any, /) -> None: ...
    def remove(self, key: Any, /) -> bool: ...
    def has(self, key: Any, /) -> bool: ...
    def position(self, key: Any, /) -> _Floats: ...
    def cell(self, key: Any, /) -> tuple[int, ...]: ...
    def cell_of(self, position: Any, /) -> tuple[int, ...]: ...
    def any_within(self, position: Any, radius: Any, skip: Any, /) -> bool: ...
    def near(self, position: Any, radius: Any, /) -> _Ints: ...
    def within(self, position: Any, radius: Any, with_shift: bool, /) -> Any: ...
    def within_many(
        self, positions: _Floats, radius: Any, with_shift: bool, /
    ) -> tuple[_Ints, Any]: ...
    def insert_many(self, ids: _Ints, tags: _Types, positions: _Array, /) -> None: ...
    def move_many(self, ids: _Ints, tags: _Types, positions: _Array, /) -> None: ...
    def remove_many(self, ids: _Ints, tags: _Types, /) -> npt.NDArray[np.bool_]: ...
    def keys(self, cursor: int, most: int, /) -> tuple[int, _Ints]: ...
    def positions(self, keys: _Ints, /) -> _Floats: ...
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
def box_wrap(points: _Array, box: _Floats, periodic: int, /) -> tuple[_Floats, _Ints]: ...
def box_places(
    points: _Array, box: _Floats | None, periodic: int, cutoff: float, largest: float, /
) -> tuple[_Floats, tuple[bool, ...], tuple[float, ...], tuple[float, ...]]: ...
def clear_cache() -> None: ...
def set_cache_limit(bytes: int, /) -> int: ...
def cache_limit() -> int: ...
def cache_held() -> int: ...
