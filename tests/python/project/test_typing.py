# SPDX-License-Identifier: BSD-3-Clause
"""What type checkers infer: the overloads of the public functions, under mypy --strict."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

import halfshell as hs

pytestmark = pytest.mark.slow

GOOD = """
from typing import Any, assert_type

import numpy as np
import numpy.typing as npt

import halfshell as hs

p = np.zeros((3, 3))
quantities: str = input()
anything: Any = quantities

assert_type(hs.pairs(p, 1.0), tuple[npt.NDArray[Any], npt.NDArray[Any]])
assert_type(hs.pairs(p, 1.0, quantities="d", sort=True), npt.NDArray[Any])
assert_type(
    hs.pairs(p, 1.0, quantities=quantities), npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]
)
with hs.settings(precision="double", kernel=None, memory_limit=1e9):
    i, j = hs.pairs(p, 1.0)

for i, j in hs.iter_pairs(p, 1.0, max_pairs=10, progress=print):
    i.sum()
blocks = hs.iter_pairs(p, 1.0, quantities=quantities)
assert_type(next(blocks), npt.NDArray[Any] | tuple[npt.NDArray[Any], ...])
m: int = hs.for_each_pair(p, 1.0, lambda i, j, S, D, d2: None, box=[1.0] * 3, thread_safe=True)

assert_type(hs.count_pairs(p, 1), int)
assert_type(hs.count_pairs(p, [0.5, 1.0]), npt.NDArray[np.int64])

assert_type(hs.pairs_between(p, p, 1.0), tuple[npt.NDArray[Any], npt.NDArray[Any]])
i, j, d = hs.pairs_between(p, p, 1.0, quantities="ijd", box=[2.0] * 3, index_dtype=np.int32)
table = hs.neighbors(p, 1.0, quantities="jd", queries=p)
assert_type(table, hs.NeighborTable)
assert_type(table[:2].sort().filter(p[:, 0] > 0), hs.NeighborTable)
assert_type(table[0], npt.NDArray[Any] | tuple[npt.NDArray[Any], ...])
assert_type(table.reverse(), npt.NDArray[np.int64])
assert_type(hs.coordination(p, 1.0, box=[2.0] * 3), npt.NDArray[np.int64])

i, j, d = hs.pairs(hs.Points(p, types=["H", "O", "O"]), {("H", "O"): 1.0}, quantities="ijd")
balls = hs.Points(p, radii=p[:, 0])
assert_type(balls, hs.Points)
assert_type(hs.count_pairs(balls, None), int)
assert_type(hs.count_pairs(hs.Points(p, types=[0, 1, 1]), {(0, 0): 1.0, (1, 1): 1.0}), int)
assert_type(hs.neighbors(balls, None, rule="gather"), hs.NeighborTable)

plan: hs.Explanation = hs.explain(p, 1.0, quantities="ijd")
verdict: hs.Verdict = hs.verify(p, 1.0, i, j)
box = hs.Box.orthorhombic(1.0, 1.0)
assert_type(box.vectors, npt.NDArray[np.float64])
assert_type(box.wrap(p), tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]])

class Atoms:
    positions = p
    cell = [1.0, 1.0, 1.0]
    pbc = True

class Tensor:
    def __dlpack__(self, *, stream: None = None) -> object:
        return p.__dlpack__()

total = hs.pairs(Atoms(), 1.0, quantities="d").sum() + hs.nearest(Tensor(), 2)[1].sum()
hs.neighbors(p, 1.0, box=box, queries=[[0.0, 0.0, 0.0]])
cells = hs.CellList(p, 1, box=np.float32(2.0))
assert_type(cells.count_pairs(), int)
assert_type(cells.count_pairs([0.5, 1.0], threads=1), npt.NDArray[np.int64])
assert_type(cells.neighbors(queries=p, inclusive=False), hs.NeighborTable)
i, j = hs.VerletList(1.0, skin="auto", box=10.0).pairs(sort=True)
verdict = hs.verify(p, 1.0, table, queries=p)
assert_type(hs.cache_info().held, int)
"""

BAD = {
    "hs.settings(precision='half')": "arg-type",
    "hs.pairs(p, 1.0, boks=None)": "call-overload",
    "hs.pairs(p, 1.0).sum()": "attr-defined",
    "m: int = hs.count_pairs(p, [1.0])": "assignment",
    "hs.count_pairs(p, 1.0, sort=True)": "call-overload",
    "hs.explain(p, 1.0, precision='exact')": "call-arg",
    "hs.neighbors(p, 1.0, sort=True)": "call-arg",
    "hs.neighbors(p, 1.0).indices = p": "misc",
    "hs.pairs_between(p)": "call-overload",
    "hs.for_each_pair(p, 1.0, print, sort=True)": "call-arg",
    "hs.neighbors(p, 'far')": "arg-type",
    "hs.neighbors(object(), 1.0)": "arg-type",
    "hs.CellList(p, 1.0).neighbors(boks=1)": "call-arg",
    "hs.CellList(p, 1.0).nearest(1, p)": "call-overload",
    "hs.VerletList(1.0).pairs('ij')": "call-overload",
    "hs.neighbors(p, None, rule='product')": "arg-type",
    "hs.Points(p, radius=p[0])": "call-arg",
}

needs_mypy = pytest.mark.skipif(
    importlib.util.find_spec("mypy") is None, reason="mypy is not installed"
)


def mypy(folder, text):
    """Run mypy --strict on a text, against the halfshell that is being tested."""
    (folder / "snippet.py").write_text(text)
    (folder / "mypy.ini").write_text("[mypy]\nstrict = true\ncache_dir = cache\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "snippet.py"], cwd=folder, capture_output=True, text=True
    )
    return done.returncode, done.stdout + done.stderr


def test_the_package_says_that_it_is_typed():
    assert (Path(hs.__file__).parent / "py.typed").exists()


@needs_mypy
def test_results_have_the_types_that_the_arguments_say(tmp_path):
    status, output = mypy(tmp_path, GOOD)
    assert status == 0, output


@needs_mypy
def test_wrong_calls_are_found(tmp_path):
    head = "import numpy as np\nimport halfshell as hs\np = np.zeros((3, 3))\n"
    status, output = mypy(tmp_path, head + "\n".join(BAD) + "\n")
    assert status == 1, output
    reported = [line for line in output.splitlines() if line.startswith("snippet.py:")]
    for number, (line, codes) in enumerate(BAD.items(), start=4):
        said = [text for text in reported if text.startswith(f"snippet.py:{number}: error")]
        assert any(f"[{code}]" in text for text in said for code in codes.split("|")), (
            f"{line}\n{output}"
        )
