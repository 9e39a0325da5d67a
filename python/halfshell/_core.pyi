from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

def pairs(
    points: npt.NDArray[Any],
    cutoff: float,
    box: npt.NDArray[np.float64] | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_bytes: int,
    out: Any,
    /,
) -> npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]: ...
def count_pairs(
    points: npt.NDArray[Any],
    cutoff: float,
    box: npt.NDArray[np.float64] | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    /,
) -> int: ...
def plain_pairs(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    inclusive: Any,
    precision: Any,
    kernel: Any,
    memory_limit: Any,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: Any,
    sort: Any,
    index_dtype: Any,
    out: Any,
    /,
) -> Any: ...  # as pairs, or NotImplemented
def plain_count(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    inclusive: Any,
    precision: Any,
    kernel: Any,
    memory_limit: Any,
    progress: Callable[[float], object] | None,
    threads: int | None,
    /,
) -> Any: ...  # as count_pairs, or NotImplemented
def batch_pairs(
    points: npt.NDArray[Any],
    cutoff: float,
    box: npt.NDArray[np.float64] | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_bytes: int,
    out: Any,
    batch: npt.NDArray[np.int64],
    cutoffs: npt.NDArray[np.float64] | None,
    boxes: npt.NDArray[np.float64] | None,
    /,
) -> npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]: ...
def batch_count(
    points: npt.NDArray[Any],
    cutoff: float,
    box: npt.NDArray[np.float64] | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    batch: npt.NDArray[np.int64],
    cutoffs: npt.NDArray[np.float64] | None,
    boxes: npt.NDArray[np.float64] | None,
    /,
) -> npt.NDArray[np.int64]: ...
def nearest(
    points: npt.NDArray[Any],
    max_distance: float,
    box: npt.NDArray[np.float64] | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_bytes: int,
    out: Any,
    queries: npt.NDArray[Any] | None,
    k: int,
    /,
) -> npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]: ...
def explain(
    points: npt.NDArray[Any],
    cutoff: float,
    box: npt.NDArray[np.float64] | None,
    periodic: int,
    inclusive: bool,
    precision: str,
    kernel: str | None,
    memory_limit: float | None,
    progress: Callable[[float], object] | None,
    threads: int | None,
    quantities: str,
    sort: bool,
    index_bytes: int,
    measure: bool,
    /,
) -> dict[str, Any]: ...
def kernels() -> tuple[str, ...]: ...
def default_kernel() -> str: ...
def build_info() -> dict[str, Any]: ...
def available_memory() -> float: ...
def box_measure(
    box: npt.NDArray[np.float64], periodic: int, /
) -> tuple[npt.NDArray[np.float64], float]: ...
def box_wrap(
    points: npt.NDArray[Any], box: npt.NDArray[np.float64], periodic: int, /
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]: ...
def clear_cache() -> None: ...
def set_cache_limit(bytes: int, /) -> int: ...
def cache_held() -> int: ...
