# SPDX-License-Identifier: BSD-3-Clause
"""`settings`: what few calls change, set around them. All searches read it once, at their start."""

from __future__ import annotations

from contextvars import ContextVar
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

from halfshell import _core
from halfshell._convert.foreign import exact_number, is_a, shown
from halfshell._convert.options import as_choice, as_threads
from halfshell._search import search

if TYPE_CHECKING:
    from contextvars import Token

    from halfshell._convert.types import Algorithm, Precision

ALGORITHMS = ("auto", "all-pairs", "grid", "hash", "hierarchy")
PRECISIONS = ("exact", "double", "single")


class Settings(NamedTuple):
    """How searches are made, as the core takes it; no answer of an exact search depends on it."""

    kernel: str | None = None
    algorithm: Algorithm = "auto"
    precision: Precision = "exact"
    memory_limit: float | None = None
    threads: int | None = None


#: Those of no `settings`.
USUAL = Settings()

_SET = ContextVar("halfshell_settings", default=USUAL)

_core.know("settings", _SET)

#: The settings of this thread or task.
current = _SET.get

# Told apart from None, which is a setting.
_KEEP: Any = type("_Keep", (), {"__repr__": lambda self: "unchanged"})()


class settings:
    """Set how searches are made, in a ``with`` statement, for this thread and its tasks.

    What is not given stays as it is around the statement. Settings are those of a context
    (`contextvars`): other threads do not see them, and tasks of asyncio keep those they began with.

    Parameters
    ----------
    kernel : str or None, optional
        One of ``kernels()``, for tests and timing. All give identical arrays. None: the value of
        the environment variable HALFSHELL_KERNEL at import, otherwise the best.
    algorithm : {"auto", "all-pairs", "grid", "hash", "hierarchy"}, optional
        How pairs are searched for. It may change time, memory and the order of unsorted pairs, but
        not the pairs. "all-pairs" tests every pair. "grid" sorts the points into cells, as many as
        suit the number of points. "hash" stores only occupied cells, of which there may be any
        number. "hierarchy" divides the points by the size of their radius, or by type, and searches
        each two parts in cells of their own. "auto" takes what is expected to be fastest; `explain`
        tells which, and why.
    precision : {"exact", "double", "single"}, optional
        "exact" decides for the exact real values of the inputs. The others make one rounded
        comparison, as most libraries do, and exist for comparison: "double" uses a fixed formula in
        float64; "single" float32 relative to the centre of a group of points, so that its answer
        near the cutoff also depends on the other points and their order.
    memory_limit : float or None, optional
        Bytes that a search and its result may take. None: what the machine has available.
    threads : int or None, optional
        What functions take for their own `threads` where they are given none.

    Raises
    ------
    TypeError, ValueError
        For a wrong setting, when it is made.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> with hs.settings(algorithm="all-pairs", threads=1):
    ...     hs.count_pairs(points, 1.5)
    1
    """

    __slots__ = ("_changes", "_tokens")

    @search()
    def __init__(
        self,
        *,
        kernel: str | None = _KEEP,
        algorithm: Algorithm = _KEEP,
        precision: Precision = _KEEP,
        memory_limit: float | None = _KEEP,
        threads: int | None = _KEEP,
    ) -> None:
        given = {
            "kernel": kernel,
            "algorithm": algorithm,
            "precision": precision,
            "memory_limit": memory_limit,
            "threads": threads,
        }
        self._changes = {
            name: _CHECKS[name](value) for name, value in given.items() if value is not _KEEP
        }
        self._tokens: list[Token[Settings]] = []

    def __enter__(self) -> Settings:
        changed = current()._replace(**self._changes)
        self._tokens.append(_SET.set(changed))
        return changed

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        _SET.reset(self._tokens.pop())

    def __repr__(self) -> str:
        changes = ", ".join(f"{name}={value!r}" for name, value in self._changes.items())
        return f"settings({changes})"


def _as_memory_limit(value: Any) -> float | None:
    from halfshell._convert.lengths import as_number  # which imports much

    if value is None:
        return None
    must = "memory_limit must be a number of bytes"
    number = exact_number(value)
    if is_a(number, bool):
        raise TypeError(f"{must}, got {shown(value)}")
    if is_a(number, int):  # it need not be a float64: what is a byte more or less
        try:
            limit = float(number or 0)
        except OverflowError:
            raise OverflowError(f"{must}, got one that is too large for float64") from None
    else:
        limit = as_number(value, "memory_limit", "be a number of bytes")
    if not limit >= 0.0:
        raise ValueError(f"{must}, got {shown(value)}")
    return limit + 0.0


_CHECKS: dict[str, Any] = {
    "kernel": lambda value: (
        None if value is None else as_choice(value, "kernel", tuple(_core.kernels()))
    ),
    "algorithm": lambda value: as_choice(value, "algorithm", ALGORITHMS),
    "precision": lambda value: as_choice(value, "precision", PRECISIONS),
    "memory_limit": _as_memory_limit,
    "threads": as_threads,
}
