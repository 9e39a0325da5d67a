# SPDX-License-Identifier: BSD-3-Clause
"""One scene: who takes part, whether the answers agree, and what each takes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from libraries.agreement import Verdict, compare, compare_counts, compare_nearest
from libraries.contestant import Call, Contestant, Halfshell
from libraries.peers import for_scene, ours_for
from measure.turns import Turn, plan_turn, single_calls, take_turns
from pages import OURS, Measurement
from scenes import Scene, load

__all__ = ["Patience", "measure_scene"]


@dataclass(frozen=True)
class Patience:
    """How long a scene may take, and how much memory."""

    repeats: int = 7  # turns of each call
    seconds: float = 60.0  # for one peer on one scene
    hold: int = 1 << 30  # bytes of held results
    largest: int = 1 << 32  # bytes of one result of ours
    quick: bool = False


def _empty_pool() -> None:
    """Give memory kept for later results back, so that new results need new memory."""
    clear = getattr(sys.modules.get("halfshell"), "clear_cache", None)
    if clear is not None:
        clear()


def measure_scene(
    scene: Scene, ours: Halfshell | None, peers: Sequence[Contestant], patience: Patience
) -> tuple[list[Measurement], bool]:
    """Compare the answers of all contestants on a scene, then time them together.

    Returns the rows of a table, none where the scene is left out, and whether our answers
    were right.
    """
    print(f"{scene.name}: {scene.stresses}", flush=True)
    ours = ours_for(ours, scene)
    reason = ours.refuses(scene) if ours is not None else None
    if scene.bytes_of_output() > patience.largest:
        reason = f"{scene.bytes_of_output() / 1e9:.1f} GB of output"
    if reason is not None:
        print(f"  left out: {reason}")
        return [], True
    rows: dict[str, Measurement] = {}
    turns: dict[str, Turn] = {}
    correct = True
    for name, contestant in _who(scene, ours, peers, patience.quick).items():
        try:
            call = contestant.prepare(scene)
            pairs, verdict = _check(scene, ours, contestant, call)
        except MemoryError:
            if contestant is ours:
                raise
            print(f"  without {name}: it asked for more memory than there is")
            continue
        if name == OURS and scene.n_pairs is not None and pairs != scene.n_pairs:
            print(f"  halfshell finds {pairs} pairs, there are {scene.n_pairs}")
            correct = False
        correct &= verdict is None or verdict.ours_wrong == 0
        rows[name] = _row(scene, contestant, name, pairs, verdict)
        turns[name] = plan_turn(call, patience.repeats, patience.seconds)
    short = {name: turn.call for name, turn in turns.items()} if scene.latency else {}
    if ours is not None:
        for name, (other, call, pairs) in _held_against(scene, ours).items():
            rows[name] = replace(_row(other, ours, name, pairs, None), scene=scene.name)
            turns[name] = plan_turn(call, patience.repeats, patience.seconds)
    _empty_pool()
    own = tuple(name for name in turns if name.startswith(OURS))
    fresh = take_turns(turns, keep=True, budget=patience.hold, yields=own, dropped=_empty_pool)
    _empty_pool()
    recycled = take_turns(turns, keep=False)
    single = single_calls(short, 200 if patience.quick else 2000)
    timed = [
        replace(
            row, repeats=turns[name].repeats, calls=turns[name].calls,
            fresh_median=fresh[name].median, fresh_min=fresh[name].minimum,
            recycled_median=recycled[name].median, recycled_min=recycled[name].minimum,
            all_held=fresh[name].all_held,
            call_median=single.get(name, (None, None))[0],
            call_p99=single.get(name, (None, None))[1],
        )
        for name, row in rows.items()
    ]  # fmt: skip
    return timed, correct


def _who(
    scene: Scene, ours: Halfshell | None, peers: Sequence[Contestant], quick: bool
) -> dict[str, Contestant]:
    """Choose who takes part, and say why others do not."""
    chosen: dict[str, Contestant] = {} if ours is None else {OURS: ours}
    for peer in peers:
        if peer.name not in scene.peers:
            continue
        one = for_scene(peer, scene)
        reason = one.refuses(scene)
        if quick and (scene.n_pairs or 0) > peer.most_pairs / 20.0:
            reason = "slow"
        if reason is None:
            chosen[peer.name] = one
        else:
            print(f"  without {peer.name}: {reason}")
    return chosen


def _check(
    scene: Scene, ours: Halfshell | None, contestant: Contestant, call: Call
) -> tuple[int, Verdict | None]:
    """Count the pairs of an answer, and compare it with ours under the same tie rule."""
    result = call()
    pairs = contestant.count(scene, result)
    if ours is None or contestant is ours:
        return pairs, None
    options = {**ours.options, "inclusive": contestant.inclusive}
    # The answer is compared without distances and vectors, which decide nothing.
    plain = scene
    if scene.task == "pairs":
        plain = replace(scene, quantities="ijS" if scene.has_images else "ij", index_dtype="int64")
    same_rule = type(ours)(options)
    answer = same_rule.prepare(plain)()
    if scene.task == "count":
        return pairs, compare_counts(int(answer), pairs)
    if scene.nearest:
        return pairs, compare_nearest(
            scene, same_rule.nearest(scene, answer), contestant.nearest(scene, result),
            contestant.float_bits,
        )  # fmt: skip
    verdict = compare(
        scene, same_rule.rows(plain, answer), contestant.rows(scene, result),
        contestant.inclusive, contestant.band(scene),
    )  # fmt: skip
    if verdict.ours_wrong:
        print(f"  {contestant.name} is right on {verdict.ours_wrong} pairs, halfshell wrong")
    return pairs, verdict


def _held_against(scene: Scene, ours: Halfshell) -> dict[str, tuple[Scene, Call, int]]:
    """Prepare what the limits of a scene compare us with: scene, call and pairs by name."""
    found: dict[str, tuple[Scene, Call, int]] = {}
    for limit in scene.limits:
        name = f"{OURS} [{limit.label}]"
        if limit.kind == "floor":
            size = scene.bytes_of_output()
            found[name] = (scene, partial(np.full, size // 8, 1), scene.n_pairs or 0)
        elif limit.kind == "rewrite":
            space = np.zeros(scene.bytes_of_output() // 8, dtype=np.int64)
            found[name] = (scene, partial(space.fill, 1), scene.n_pairs or 0)
        elif limit.kind == "variant":
            variant = Halfshell({**ours.options, **limit.options})
            if variant.refuses(scene):
                continue
            call = variant.prepare(scene)
            found[name] = (scene, call, variant.count(scene, call()))
        elif limit.kind in ("scene", "growth"):
            other = load(limit.other)
            asked = ours_for(Halfshell(ours.options), other) or ours
            call = asked.prepare(other)
            found[name] = (other, call, asked.count(other, call()))
    return found


def _row(
    scene: Scene, contestant: Contestant, name: str, pairs: int, verdict: Verdict | None
) -> Measurement:
    """Start a row; the times are filled in later."""
    return Measurement(
        scene=scene.name, contestant=name, version=contestant.version() or "", task=scene.task,
        n=scene.n, dim=scene.dim, cutoff=scene.cutoff, quantities=scene.quantities,
        index_dtype=scene.index_dtype, pairs=pairs, repeats=0, calls=0, fresh_median=0.0,
        fresh_min=0.0, recycled_median=0.0, recycled_min=0.0, all_held=True,
        complete=verdict is None or verdict.complete,
        agreement="not compared" if verdict is None else str(verdict),
        threads=scene.threads, systems=1 if scene.batch is None else int(scene.batch[-1]) + 1,
    )  # fmt: skip
