# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C stops a long search at once and leaves nothing behind."""

import pytest

from subprocesses import RESIDENT, run

pytestmark = pytest.mark.slow

SEARCHES = {
    "pairs": "hs.pairs(points, 0.16)",
    "sorted pairs": "hs.pairs(points, 0.16, sort=True, quantities='ijdDS')",
    "neighbors": "hs.neighbors(points, 0.16, quantities='jdDS')",
    "pairs of two sets": "hs.pairs_between(points[1::2], points, 0.16)",
    "count": "hs.count_pairs(points, 0.5)",
    "count of many cutoffs": "hs.count_pairs(points, np.linspace(0.4, 0.5, 50))",
    "clusters": "hs.clusters(points, 0.3)",
    "pairs of balls": "hs.pairs(balls, None, sort=True)",
    "count of ellipsoids": "hs.count_pairs(ellipsoids, 4.0)",
    "batch of ellipsoids": "hs.pairs(ellipsoids.replace(batch=np.sort(kinds)), 4.0)",
    "blocks": "next(hs.iter_pairs(points, 2.0, max_pairs=10**9))",
    "calls": "hs.for_each_pair(points, 2.0, lambda *pair: None)",
    "batch": """while True:
        hs.pairs(hs.Points(points, batch=np.arange(400_000) // 30), 2.0, threads=2)""",
    "counts of a batch": """while True:
        hs.count_pairs(hs.Points(points, batch=np.arange(400_000) // 30), 2.0, threads=1)""",
    "histogram": "hs.pair_histogram(points, np.linspace(0.0, 0.5, 100))",
    "measure": """i = np.arange(10**6) % 500
    while True:
        hs.measure(points, i, i + 1, box=[[0.3, 0.1, 0], [0, 0.3, 0], [0, 0, 0.3]])""",
    "nearest": "hs.nearest(points, 100)",
    "nearest, all equally far": """hs.nearest(
        np.concatenate([points > 0.5] * 5), 1_000_000, queries=points[:9] * 0 + 0.5
    )""",
    "candidates of many images": "hs.CellList(points[:3000, :1], 1e6, box=[1.0]).candidates()",
    "count of a million boxes, many": "hs.count_pairs(points[:3000, :1], 1e6, box=[1.0])",
    "rows of cells of many images": "hs.CellList(points[:9], 1e3, box=[1.0] * 3).candidates()",
    "images that are left out": """hs.count_pairs(
        points[:2000], 2.0, box=[[0.3, 0.1, 0], [0, 0.3, 0], [0, 0, 0.3]],
        exclude=np.stack(np.triu_indices(2000, 1), axis=1),
    )""",
    "count of many images": "hs.count_pairs(points[:1000], 60.0, box=[1.0] * 3)",
    "wrap": "hs.Box([[1, 0, 0], [0.4, 1, 0], [0.3, 0.2, 1]]).wrap(np.concatenate([points] * 16))",
    "connectivity": "hs.Connectivity(lists(0.08))",
    "overlap of images": "hs.Connectivity(lists(0.02), box=1.0, overlap=True)",
    "intersection of images": "hs.Connectivity(lists(0.02), box=1.0, intersection=True)",
    "intersection by threads": "hs.Connectivity(lists(0.02), intersection=True, threads=2)",
    "patches": """c = hs.Connectivity(lists(0.015))
    keep = [np.ones(n, bool) for n in c.n_nodes]
    while True:
        c.patch(keep)""",
    "removal": """c = hs.Connectivity(lists(0.01))
    while True:
        c.remove(np.zeros(len(c.pairs), bool))""",
    "count of exact ties": "hs.count_pairs(grid, 40.0, box=[60.0] * 3)",
}


@pytest.mark.parametrize("search", SEARCHES.values(), ids=SEARCHES)
def test_an_interrupt_stops_the_search(search):
    # The signal is raised by a second thread, which also shows that the lock is released. What a
    # search still does is told by processor time, of all its threads: it is that of no other
    # program.
    body = search.replace("\n", "\n    ")
    result = run(
        RESIDENT
        + f"""
import gc, json, signal, threading, time
import numpy as np
import halfshell as hs

rng = np.random.default_rng(1)
points = rng.random((400_000, 3))
sizes, kinds = 0.08 * 2.0 ** -rng.random(len(points)), np.arange(len(points)) % 9
balls, tensors = hs.Points(points, radii=sizes), np.eye(3) / sizes[:, None, None]
ellipsoids = hs.Points(points, supports=tensors)  # none is freed: malloc would keep as much later
grid = np.stack(np.meshgrid(*[np.arange(60.0)] * 3), axis=-1).reshape(-1, 3)
small = points[:500]

def lists(h):
    return [
        hs.NodeList(str(k), part, np.full(len(part), h))
        for k, part in enumerate(np.array_split(points, 3))
    ]

expected = hs.count_pairs(small, 0.2)
hs.count_pairs(points, 0.001)
gc.collect()
before = resident()
sent = []

def interrupt():
    sent.extend([time.process_time(), time.perf_counter()])
    signal.raise_signal(signal.SIGINT)

limit = hs.settings(memory_limit=1e13)
threading.Timer(0.4, interrupt).start()
try:
    with limit:
        {body}
    outcome = "finished"
except KeyboardInterrupt:
    outcome = "interrupted"
begun, begun_by_clock = sent or [0.0, 0.0]
delay, by_clock = time.process_time() - begun, time.perf_counter() - begun_by_clock
c = None
hs.clear_cache()
gc.collect()
is_right = hs.count_pairs(small, 0.2) == expected
print(json.dumps([outcome, delay, by_clock, resident() - before, is_right]))
"""
    )
    outcome, delay, by_clock, grown, right = result
    assert outcome == "interrupted"
    assert delay < 1.0
    assert by_clock < 30.0  # nothing sleeps
    assert grown < 30_000_000
    assert right


def test_an_interrupt_leaves_a_dynamic_list_as_it_was_or_as_it_is_to_be():
    """Signals come from another process: an insertion keeps the interpreter's lock."""
    found = run(
        """
import json, os, signal, subprocess
import numpy as np
import halfshell as hs

n = 1_500_000
points = np.random.default_rng(0).random((n, 3))
keys = np.arange(n)
found = []
for begun in (0, 1000):
    for wait in ("0.02", "0.2", "0.5", "0.8"):
        cells = hs.DynamicCellList(3, 0.05)
        cells.insert_many(keys[:begun], points[:begun])
        send = f"sleep {wait}; kill -INT {os.getpid()}"
        try:
            with subprocess.Popen(["sh", "-c", send]):
                cells.insert_many(keys, points)
        except KeyboardInterrupt:
            pass
        near = sorted(cells.within(points[5], 0.05).tolist())
        some = points[: len(cells)]
        true = np.flatnonzero(((some - points[5]) ** 2).sum(axis=1) <= 0.05**2).tolist()
        found.append(len(cells) in (begun, n) and (near == true))
print(json.dumps(found))
"""
    )
    assert found == [True] * 8
