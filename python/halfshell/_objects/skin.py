# SPDX-License-Identifier: BSD-3-Clause
"""The skin of a `VerletList` with skin="auto", and whether a list pays at all: by counts of work.

No clock is read: the same points give the same lists, and so the same order of pairs, in every
run and on every machine.
"""

from __future__ import annotations

import math

FIRST_SHARE = 0.1  # of the cutoff: the first skin
SHARES = [2.0 ** (k / 4.0) for k in range(-40, 1)]  # of the cutoff: all skins that are considered
MOST_CHANGES = 6  # then it is settled, whatever it is
STEPS_TO_WAIT = 32  # a list that lasts longer than this is looked at all the same
WORTHWHILE = 0.95  # a change must promise at most this share of the time
SEARCHES = 1000  # steps that are searched before a list is tried again

# Nanoseconds, as benchmarks/verlet.py has measured them for i and j in three dimensions, without
# what writing the pairs takes, which is the same for both: each call, each point, each pair that
# is listed or found.
_USE = (50e3, 50.0, 0.95)
_BUILD = (50e3, 170.0, 4.6)
_SEARCH = (15e3, 80.0, 2.1)


class AutoSkin:
    """Chooses a skin, or a search in every step, by what has to be done.

    With a skin s a step takes ``build / lasts(s) + use``, each of which grows with the pairs that
    are listed, and these with ``(cutoff + s)**d``. lasts(s) is s over what a step has used up of
    the skin.

    It looks when a list is used up, and at one that lasts long after STEPS_TO_WAIT steps. There are
    at most MOST_CHANGES changes, and none after a look that found nothing WORTHWHILE: it settles.
    In three dimensions it also compares with a search, at every look: `searches` says that no list
    is wanted for the next SEARCHES steps.
    """

    def __init__(self, cutoff: float) -> None:
        self.cutoff = cutoff
        self._start()

    def _start(self) -> None:
        self.skin = FIRST_SHARE * self.cutoff  # of the list in use
        self.is_settled = self.cutoff == 0.0  # there is no length to go by
        self.searches = False
        self._chosen = self.skin  # for the next one
        self._n_changes = 0
        self._n_points = 0  # of the list in use
        self._n_listed = 0
        self._steps = 0  # since it was built
        self._spent = 0.0  # of the skin, since then
        self._searched = 0

    def next_skin(self) -> float:
        """The skin for the list that is built next."""
        return self._chosen

    def wants_change(self, ndim: int) -> bool:
        """Whether to build now, though it may not be needed."""
        if self._steps >= STEPS_TO_WAIT and not self.is_settled:
            self._look(self._spent / self._steps, ndim)
        return self._chosen != self.skin

    def searched(self) -> None:
        """A step was searched."""
        self._searched += 1
        if self._searched == SEARCHES:
            self._start()

    def updated(
        self, rebuilt: bool, margin: float, ndim: int, n_points: int, n_listed: int
    ) -> None:
        """A step was taken; `margin` is what it would have left of the list before."""
        if not rebuilt:
            self._steps += 1
            self._spent = max(self._spent, self.skin - margin)
            return
        if self._chosen != self.skin:
            self.skin = self._chosen
        elif not math.isinf(margin):
            self._look((self.skin - margin) / (self._steps + 1), ndim)
        self._n_points = n_points
        self._n_listed = n_listed
        self._steps = 0
        self._spent = 0.0

    def _look(self, a_step: float, ndim: int) -> None:
        """Choose what promises most, for points that use up so much of the skin in a step."""
        if self.cutoff == 0.0:
            return
        times = {
            share * self.cutoff: self.list_time(share * self.cutoff, a_step, ndim)
            for share in SHARES
        }
        best = min(times, key=lambda skin: times[skin])
        if ndim == 3 and self.search_time(ndim) < WORTHWHILE * times[best]:
            self.searches = True
            return
        if self.is_settled:
            return
        now = self.list_time(self.skin, a_step, ndim)
        if self._n_changes == MOST_CHANGES or not times[best] < WORTHWHILE * now:
            self.is_settled = True
            return
        self._n_changes += 1
        self._chosen = best

    def list_time(self, skin: float, a_step: float, ndim: int) -> float:
        """Nanoseconds a step with a list of this skin."""
        lasts = max(1.0, skin / a_step) if a_step > 0.0 else math.inf
        listed = self._pairs_within(skin, ndim)
        return self._time(_BUILD, listed) / lasts + self._time(_USE, listed)

    def search_time(self, ndim: int) -> float:
        """Nanoseconds a step that is searched."""
        return self._time(_SEARCH, self._pairs_within(0.0, ndim))

    def _pairs_within(self, skin: float, ndim: int) -> float:
        """About how many pairs there are within the cutoff and that skin."""
        return self._n_listed * ((self.cutoff + skin) / (self.cutoff + self.skin)) ** ndim

    def _time(self, parts: tuple[float, float, float], pairs: float) -> float:
        return parts[0] + parts[1] * self._n_points + parts[2] * pairs
