# SPDX-License-Identifier: BSD-3-Clause
"""Duck-typed access to objects of other libraries (ASE, MDAnalysis, ...).

Reading a type, an attribute or a text may run code of theirs. What it raises becomes the cause of a
TypeError that names the argument; MemoryError and Ctrl-C, which are no fault of the input, pass.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

_SHOWN = 80  # characters of a value in a message
_MOST_LEVELS = 32  # of nested lists; points need two


def is_a(value: Any, kinds: type | tuple[type, ...]) -> bool:
    """`isinstance` that only the type decides, not what an object says of its class."""
    return issubclass(type(value), kinds)


def kind_of(value: Any) -> str:
    return type(value).__name__


def shown(value: Any) -> str:
    """Its repr on one line, cut to what fits a message; the name of its type if it has none."""
    try:
        text = " ".join(repr(value).split())
    except MemoryError:
        raise
    except Exception:  # hostile, or an integer of more digits than Python writes
        return f"a value of type {kind_of(value)}"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def told(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:
        return "and does not say why"


def attribute(value: Any, name: str, argument: str, default: Any = None) -> Any:
    """An attribute, or `default` where there is none; TypeError if asking for it raises."""
    return read(argument, value, lambda: getattr(value, name, default), f".{name}")


def read(argument: str, value: Any, get: Callable[[], Any], part: str = "") -> Any:
    """What `get` returns; what it raises, of code that is not ours, becomes a TypeError."""
    try:
        return get()
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(
            f"{argument} cannot be read: {kind_of(value)}{part} raised {kind_of(error)}: "
            f"{told(error)}"
        ) from error


def exact_number(value: Any) -> int | float | bool | None:
    """The plain number that an object is, whatever its methods say; None if it is none.

    Python's int and float, NumPy's integers, bool, float64 and narrower, and subclasses of these.
    """
    if is_a(value, bool) or type(value) in (int, float):
        return value  # type: ignore[no-any-return]
    if is_a(value, np.timedelta64):  # one of NumPy's integers, by its type
        return None
    if is_a(value, (np.float64, np.float32, np.float16, np.integer, np.bool_)):
        return np.generic.item(value)  # type: ignore[no-any-return]
    if is_a(value, float):
        return float.__float__(value)
    if is_a(value, int):
        return int.__index__(value)
    return None


def whole_number(value: Any, argument: str) -> int | None:
    """The integer that an object is or stands for; None if it is none."""
    number = exact_number(value)
    if number is not None:
        return number if isinstance(number, int) else None

    def index() -> int | None:
        try:
            return operator.index(value)
        except TypeError:
            return None

    found: int | None = read(argument, value, index)
    return found


def refuse_deep_lists(values: Any, name: str) -> None:
    """Raise ValueError for lists in lists without end, on which NumPy would not come back.

    The first items decide: NumPy looks into the others no deeper than into them.
    """
    for _ in range(_MOST_LEVELS):
        if not is_a(values, (list, tuple)):
            return
        kind: Any = list if is_a(values, list) else tuple
        if not kind.__len__(values):
            return
        values = kind.__getitem__(values, 0)
    raise ValueError(
        f"{name} must be a rectangular array of numbers: lists are nested more than "
        f"{_MOST_LEVELS - 1} levels deep"
    )


@contextmanager
def of_argument(name: str) -> Iterator[None]:
    """Say `name` where the core speaks of a cutoff, which this call has under another name."""
    try:
        yield
    except (MemoryError, ValueError, OverflowError) as error:
        if not (len(error.args) == 1 and isinstance(error.args[0], str)):
            raise
        error.args = (re.sub(r"\b(the )?cutoff\b", name, error.args[0]),)
        raise


# ---- tensors ---------------------------------------------------------------------------------

# As DLPack numbers them; 1 and the pinned kinds 3 and 11 are memory that the CPU reads.
_ELSEWHERE = {
    2: "CUDA", 4: "OpenCL", 7: "Vulkan", 8: "Metal", 10: "ROCm", 12: "an external device",
    13: "CUDA, managed", 14: "oneAPI", 15: "WebGPU", 16: "Hexagon", 17: "MAIA",
}  # fmt: skip


def refuse_tensor(values: Any, name: str) -> None:
    """TypeError for what is sparse, on another device, or needs a gradient."""
    kind = kind_of(values)
    if _is_sparse(values, name):
        raise TypeError(f"{name} must be dense, got a sparse {kind}: convert it first")
    if attribute(values, "requires_grad", name) is True:
        raise TypeError(
            f"{name} must not need a gradient, which would be lost, got a {kind} that does: give "
            "its detach(), or use halfshell.torch"
        )
    device = _device_of(values)
    if device is not None:
        raise TypeError(
            f"{name} must be in memory that the CPU reads, got a {kind} on {device}: copy it there"
        )


def _is_sparse(values: Any, name: str) -> bool:
    if attribute(values, "is_sparse", name) is True:  # of torch
        return True
    if str(attribute(values, "layout", name, "")).startswith("torch.sparse"):
        return True
    # of SciPy, CuPy and the like
    return all(attribute(values, part, name) is not None for part in ("nnz", "shape", "tocsr"))


def _device_of(values: Any) -> str | None:
    """The name of a device that the CPU does not read."""
    try:
        device = values.__dlpack_device__()[0]
    except MemoryError:
        raise
    except Exception:  # it has none, or does not tell: then it is converted, or that fails
        return None
    return _ELSEWHERE.get(int(device)) if is_a(device, int) else None
