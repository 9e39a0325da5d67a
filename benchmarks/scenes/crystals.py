# SPDX-License-Identifier: BSD-3-Clause
"""Crystals whose cutoff lies on a shell of neighbours, or a hair beside it."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from scenes.make import DIAMOND, FCC, crystal
from scenes.registry import add
from scenes.scene import FAST_PEERS, Limit, Scene

_CRYSTAL_COST = Limit("variant", 2.0, {"precision": "single"})

# Many roundings away from the shell, yet far within what float32 can tell apart.
_BESIDE = 1e-12

_Kind = tuple[str, NDArray[np.int64], int, float, float]
_KINDS: dict[str, _Kind] = {
    "fcc-shell": ("a shell within rounding of the cutoff: the later stages decide",
                  FCC, 14, 4.05, 8.1),
    "fcc-tie": ("a shell at exactly the cutoff: the last stage, and the tie rule",
                FCC, 14, 4.0, 8.0),
    "diamond-shell": ("a shell within rounding of the cutoff, more neighbours",
                      DIAMOND, 12, 5.431, 10.862),
}  # fmt: skip


def _crystal(kind: str, beside: float, name: str) -> Scene:
    stresses, basis, repeats, constant, cutoff = _KINDS[kind]
    if beside:
        stresses = f"a shell {abs(beside):g} {'within' if beside > 0.0 else 'beyond'} the cutoff"
    points, box = crystal(basis, repeats, constant)
    return Scene(
        name, stresses, points, cutoff + beside, box, (True,) * 3, limits=(_CRYSTAL_COST,),
        peers=FAST_PEERS,
    )  # fmt: skip


for _kind in _KINDS:
    _exactly = partial(_crystal, _kind, 0.0)
    add("main", _kind)(_exactly)
    add("S3", _kind)(_exactly)
    add("S3", f"{_kind}-below")(partial(_crystal, _kind, -_BESIDE))
    add("S3", f"{_kind}-above")(partial(_crystal, _kind, _BESIDE))
