# SPDX-License-Identifier: BSD-3-Clause
"""What a `VerletList` remembers of its steps to tell which pairs formed and broke."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy.typing as npt

from halfshell._convert.options import check_letters
from halfshell._convert.types import Arrays
from halfshell._objects.pair_changes import PairChanges, Step, compare

__all__ = ["TrackedSteps"]


class TrackedSteps:
    """The last step and the one before, and their pairs, where these are known."""

    def __init__(self) -> None:
        self._steps: list[Step] = []
        self._pairs: list[dict[tuple[str, int], tuple[npt.NDArray[Any], ...]]] = []

    def take(self, step: Step) -> None:
        """Go on to the next step, whose points are now owned."""
        self._steps = [*self._steps[-1:], step]
        self._pairs = [*self._pairs[-1:], {}]

    def changes(
        self,
        quantities: str,
        index_bytes: int,
        find: Callable[[str, bool, int, None], Arrays],
        search: Callable[[Step, str, bool, int, None], Arrays],
    ) -> PairChanges:
        """Formed and broken pairs. `find` those of the last step, `search` for those of another."""
        now = self._steps[-1]
        nothing = Step(now.points[:0], now.vectors, now.bits)
        before = self._steps[0] if len(self._steps) == 2 else nothing
        check_letters(quantities)
        letters = quantities + "".join(letter for letter in "ijS" if letter not in quantities)
        key = (letters, index_bytes)
        new: Arrays | None = self._pairs[-1].get(key)
        if new is None:
            new = find(letters, True, index_bytes, None)
        old: Arrays | None = self._pairs[0].get(key) if before is not nothing else None
        if old is None:
            old = search(before, letters, True, index_bytes, None)
        assert isinstance(new, tuple) and isinstance(old, tuple)  # of three at least
        self._pairs = [{key: old}, {key: new}][-len(self._steps) :]
        column = [letters.index(letter) for letter in "ijS"]
        broken, formed = compare(
            before, tuple(old[k] for k in column), now, tuple(new[k] for k in column)
        )

        def rows(columns: tuple[npt.NDArray[Any], ...], which: npt.NDArray[Any]) -> Arrays:
            chosen = tuple(column[which] for column in columns[: len(quantities)])
            return chosen[0] if len(chosen) == 1 else chosen

        return PairChanges(rows(new, formed), rows(old, broken))
