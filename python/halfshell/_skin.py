# SPDX-License-Identifier: BSD-3-Clause
"""The skin of a `VerletList` that nobody chose: measured, changed a few times, then left alone."""

from __future__ import annotations

import math

FIRST_SHARE = 0.1  # of the cutoff: the first skin
SHARES = [2.0 ** (k / 4.0) for k in range(-40, 1)]  # of the cutoff: all skins that are considered
MOST_CHANGES = 6  # then it is settled, whatever it is
STEPS_TO_LEARN = 3  # updates without a build before anything is known
STEPS_TO_WAIT = 32  # a list that lasts longer than this is looked at all the same
WORTHWHILE = 0.95  # a change must promise at most this share of the time


class AutoSkin:
    """Chooses a skin by what steps take.

    With a skin s a step takes ``(build / lasts(s) + use) * (cutoff + s)**d``: the time to build
    shared by the steps that the list lasts for, and the time to use it, both in proportion to the
    pairs listed. lasts(s) is s over what a step uses up of the skin, as measured.

    It settles: there are at most MOST_CHANGES changes, and none after one that did not promise
    WORTHWHILE.
    """

    def __init__(self, cutoff: float) -> None:
        self.cutoff = cutoff
        self.skin = FIRST_SHARE * cutoff
        self.is_settled = cutoff == 0.0  # there is no length to go by
        self._chosen = self.skin
        self._n_changes = 0
        self._ndim = 3
        self._build = math.inf  # seconds, at the present skin
        self._use = math.inf
        self._steps = 0  # since it was built
        self._spent = 0.0  # of the skin, since then

    def next_skin(self) -> float:
        """The skin for the list that is built next."""
        return self._chosen

    def wants_change(self) -> bool:
        """Whether to build now, though it is not needed."""
        if self.is_settled or self._steps < STEPS_TO_WAIT or math.isinf(self._use):
            return False
        self._choose()
        if self._chosen == self.skin:
            return False
        return True

    def used(self, seconds: float) -> None:
        """The list was used, which took so long."""
        self._use = min(self._use, seconds)

    def updated(self, rebuilt: bool, seconds: float, margin: float, ndim: int) -> None:
        """A step was taken."""
        self._ndim = ndim
        if not rebuilt:
            self._steps += 1
            self._spent = max(self._spent, self.skin - margin)
            self._learn()
            return
        if self._chosen != self.skin:
            self.skin = self._chosen
            self._build = self._use = math.inf
        self._build = min(self._build, seconds)
        self._steps = 0
        self._spent = 0.0

    def _learn(self) -> None:
        """When half of the skin is gone, or at the last moment, decide what comes next."""
        if self.is_settled or self._steps < STEPS_TO_LEARN or math.isinf(self._use):
            return
        if 2.0 * self._spent >= self.skin and self._chosen == self.skin:
            self._choose()

    def _choose(self) -> None:
        a_step = self._spent / self._steps
        times = {share * self.cutoff: self._time(share * self.cutoff, a_step) for share in SHARES}
        best = min(times, key=lambda skin: times[skin])
        if self._n_changes >= MOST_CHANGES or not (
            times[best] < WORTHWHILE * self._time(self.skin, a_step)
        ):
            self.is_settled = True
            return
        self._n_changes += 1
        self._chosen = best

    def _time(self, skin: float, a_step: float) -> float:
        """Seconds a step, as far as they depend on the skin."""
        pairs = ((self.cutoff + skin) / (self.cutoff + self.skin)) ** self._ndim
        lasts = max(1.0, math.floor(skin / a_step)) if a_step > 0.0 else math.inf
        return pairs * (self._build / lasts + self._use)
