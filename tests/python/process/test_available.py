# SPDX-License-Identifier: BSD-3-Clause
"""How much memory is left, by what Linux says of the machine; test_available_memory.py has the
control groups."""

import os
import subprocess
import sys

import pytest

from c_builds import compile, needs_c
from checkout import SUPPORT

MEGA = 1 << 20

pytestmark = [
    needs_c,
    pytest.mark.skipif(
        not sys.platform.startswith("linux"), reason="only Linux has such files, and preloads"
    ),
]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "files_elsewhere.so"
    compile("-O1", "-shared", "-fPIC", SUPPORT / "files_elsewhere.c", "-o", path, "-ldl")
    return path


@pytest.fixture
def available(library, tmp_path):
    """A function from {path: text} to what is left then, in megabytes."""

    def ask(files):
        for path, text in files.items():
            there = tmp_path / path.lstrip("/")
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_text(text)
        environment = {**os.environ, "LD_PRELOAD": str(library), "ELSEWHERE": str(tmp_path)}
        script = "from halfshell import _core; print(_core.available_memory())"
        done = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, env=environment
        )
        assert done.returncode == 0, done.stderr
        return float(done.stdout) / MEGA

    return ask


def machine(megabytes):
    return {"/proc/meminfo": f"MemTotal: 99999999 kB\nMemAvailable: {megabytes * 1024} kB\n"}


def test_where_the_machine_says_nothing_all_its_memory_counts(available):
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGESIZE") / MEGA
    assert available({}) == pages


def test_the_lesser_of_machine_and_group_counts(available):
    folder = "/sys/fs/cgroup/one"
    group = {
        "/proc/self/cgroup": "0::/one\n",
        "/proc/self/mountinfo": "31 23 0:28 / /sys/fs/cgroup rw - cgroup2 cgroup2 rw\n",
        f"{folder}/memory.max": f"{500 * MEGA}\n",
        f"{folder}/memory.current": f"{100 * MEGA}\n",
    }
    assert available(machine(900) | group) == 400
    assert available(machine(300)) == 300
