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
    quantities: str,
    sort: bool,
    index_bytes: int,
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
    /,
) -> int: ...
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
    quantities: str,
    sort: bool,
    index_bytes: int,
    measure: bool,
    /,
) -> dict[str, Any]: ...
def kernels() -> tuple[str, ...]: ...
def build_info() -> dict[str, Any]: ...
def available_memory() -> float: ...
def box_measure(
    box: npt.NDArray[np.float64], periodic: int, /
) -> tuple[npt.NDArray[np.float64], float]: ...
def box_wrap(
    points: npt.NDArray[Any], box: npt.NDArray[np.float64], periodic: int, /
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]: ...
