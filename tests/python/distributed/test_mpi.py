# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.mpi`: on any number of ranks the pairs of one search, and errors on all of them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import halfshell as hs
from brick_scenes import LETTERS, in_order, same, scenes, serial
from checkout import ROOT, SUPPORT
from halfshell._convert.points import Points
from halfshell._functions.bricks import summary
from halfshell.mpi import exchange


def mpiexec():
    """The command of Open MPI, which a package of Python may have brought; skips without it."""
    pytest.importorskip("mpi4py", reason="mpi4py is not installed")
    import mpi4py

    beside = Path(mpi4py.__file__).parents[4] / "bin" / "mpiexec"
    found = str(beside) if beside.exists() else shutil.which("mpiexec")
    if found is None:
        pytest.skip("mpiexec is not installed")
    said = subprocess.run([found, "--version"], capture_output=True, text=True).stdout
    if "Open MPI" not in said:
        pytest.skip("mpiexec is not that of Open MPI")
    return found


@pytest.mark.slow
@pytest.mark.parametrize("what", ["answers", "refusals"])
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_ranks(ranks, what):
    start(ranks, SUPPORT / "ranks.py", what)


@pytest.mark.slow
def test_the_page_runs(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/mpi.md").read_text(), re.DOTALL)
    (tmp_path / "program.py").write_text(code)
    assert start(2, tmp_path / "program.py").strip().isdecimal()


def start(ranks, *program):
    """Run a program of Python on some ranks; what they wrote."""
    command = [mpiexec(), "--oversubscribe", "-n", str(ranks), sys.executable, "-W", "ignore"]
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    paths = os.pathsep.join([str(SUPPORT), str(Path(hs.__file__).parents[1])])
    done = subprocess.run(
        [*command, *map(str, program)], capture_output=True, text=True, timeout=120,
        env={**os.environ, **allowed, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


class Alone:
    """A communicator of one rank, which needs no MPI."""

    def gather(self, one):
        return [one]

    def bcast(self, one):
        return one

    def allgather(self, one):
        return [one]

    def alltoall(self, many):
        return many

    def Get_rank(self):
        return 0

    def Get_size(self):
        return 1


class Others(Alone):
    """A communicator in which another rank brings what it is told to."""

    def __init__(self, change):
        self.change = change

    def gather(self, one):
        fields = {name: self.change[name] for name in self.change if hasattr(one, name)}
        terms = {name: self.change[name] for name in self.change if name not in fields}
        return [one, one._replace(terms=one.terms._replace(**terms), **fields)]


class Beyond(Alone):
    """A rank that is not rank 0, and hears what that said."""

    def __init__(self, said):
        self.said = said

    def gather(self, one):
        return None

    def bcast(self, one):
        return self.said


def test_one_rank():
    for points, cutoff, scene in scenes().values():
        brick, held = exchange(Alone(), points, cutoff, **scene)
        assert len(brick.needed) == 0
        found = brick.pairs(held, quantities=LETTERS)
        assert same(in_order(found), serial(points, cutoff, scene))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cutoff": 2.0}, r"cutoff must be the same .*got 1.0 on rank 0 and 2.0 on rank 1"),
        ({"box": None}, r"box must be the same on all ranks, got \[\[.* and None on rank 1"),
        ({"periodic": (True, False, True)}, "periodic must be the same"),
        ({"rule": "max"}, "rule must be the same .*None on rank 0 and 'max' on rank 1"),
        ({"fields": ("radii",)}, "what is known of points must be the same"),
        ({"ndim": 2}, "one width and type on all ranks, got 3 columns of float64"),
        ({"dtype": "float32"}, "3 of float32 on rank 1"),
        ({"summary": summary(Points._of(np.full((2, 3), np.nan)), 2)}, r"points\[4, 0\]"),
        ({"error": ValueError("no points")}, "rank 1: no points"),
    ],
)
def test_ranks_that_differ(changes, words):
    with pytest.raises(ValueError, match=words):
        exchange(Others(changes), np.zeros((4, 3)), 1.0, box=[1.0, 1.0, 1.0])


def test_each_rank_raises_what_rank_0_said():
    with pytest.raises(MemoryError, match="all of it"):
        exchange(Beyond(MemoryError("all of it")), np.zeros((4, 3)), 1.0)
    with pytest.raises(RuntimeError, match=r"rank 1: .*what is that"):
        exchange(Others({"error": KeyError("what is that")}), np.zeros((4, 3)), 1.0)


def test_a_rank_that_fails_last_is_heard_by_all():
    class Failed(Alone):
        def allgather(self, one):
            return [one, MemoryError("no room")]

    with pytest.raises(MemoryError, match="rank 1: no room"):
        exchange(Failed(), np.zeros((4, 3)), 1.0)


def test_what_is_no_communicator():
    with pytest.raises(TypeError, match=r"communicator of mpi4py \(the extra halfshell\[mpi\]\)"):
        exchange(None, np.zeros((4, 3)), 1.0)
