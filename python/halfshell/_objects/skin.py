# SPDX-License-Identifier: BSD-3-Clause
"""The skin of a `VerletList` with skin="auto": measured, changed a few times, then left alone."""

from __future__ import annotations

import math

FIRST_SHARE = 0.1  # of the cutoff: the first skin
SHARES = [2.0 ** (k / 4.0) for k in range(-40, 1)]  # of the cutoff: all skins that are considered
MOST_CHANGES = 6  # then it is settled, whatever it is
STEPS_TO_WAIT = 32  # a list that lasts longer than this is looked at all the same
WORTHWHILE = 0.95  # a change must promise at most this share of the time


class AutoSkin:
    """Chooses a skin by what steps take.

    With a skin s a step takes ``(build / lasts(s) + use) * (cutoff + s)**d``: the time to build,
    shared by the steps that the list lasts for, and the time to use it, both in proportion to the
    pairs listed. lasts(s) is s over what a step has used up of the skin.

    It looks when a list is used up, and at one that lasts long after STEPS_TO_WAIT steps. There are
    at most MOST_CHANGES changes, and none after a look that found nothing WORTHWHILE: it settles.
    """

    def __init__(self, cutoff: float) -> None:
        self.cutoff = cutoff
        self.skin = FIRST_SHARE * cutoff  # of the list in use
        self.is_settled = cutoff == 0.0  # there is no length to go by
        self._chosen = self.skin  # for the next one
        self._n_changes = 0
        self._build = math.inf  # seconds, at the present skin
        self._use = math.inf
        self._steps = 0  # since it was built
        self._spent = 0.0  # of the skin, since then

    def next_skin(self) -> float:
        """The skin for the list that is built next."""
        return self._chosen

    def wants_change(self, ndim: int) -> bool:
        """Whether to build now, though it may not be needed."""
        if self._steps >= STEPS_TO_WAIT:
            self._look(self._spent / self._steps, ndim)
        return self._chosen != self.skin

    def used(self, seconds: float) -> None:
        """The list was used, which took so long."""
        self._use = min(self._use, seconds)

    def updated(self, rebuilt: bool, seconds: float, margin: float, ndim: int) -> None:
        """A step was taken; `margin` is what it would have left of the list before."""
        if not rebuilt:
            self._steps += 1
            self._spent = max(self._spent, self.skin - margin)
            return
        if self._chosen != self.skin:
            self.skin = self._chosen
            self._build = self._use = math.inf
        elif not math.isinf(margin):
            self._look((self.skin - margin) / (self._steps + 1), ndim)
        self._build = min(self._build, seconds)
        self._steps = 0
        self._spent = 0.0

    def _look(self, a_step: float, ndim: int) -> None:
        """Choose the skin that promises most, for points that use up so much of it in a step."""
        if self.is_settled or math.isinf(self._use) or math.isinf(self._build):
            return
        times = {
            share * self.cutoff: self._time(share * self.cutoff, a_step, ndim) for share in SHARES
        }
        best = min(times, key=lambda skin: times[skin])
        if self._n_changes == MOST_CHANGES or not (
            times[best] < WORTHWHILE * self._time(self.skin, a_step, ndim)
        ):
            self.is_settled = True
            return
        self._n_changes += 1
        self._chosen = best

    def _time(self, skin: float, a_step: float, ndim: int) -> float:
        """Seconds a step, as far as they depend on the skin."""
        pairs = ((self.cutoff + skin) / (self.cutoff + self.skin)) ** ndim
        lasts = max(1.0, skin / a_step) if a_step > 0.0 else math.inf
        return pairs * (self._build / lasts + self._use)
