# SPDX-License-Identifier: BSD-3-Clause
"""How much memory is left, by what Linux says of the machine and of control groups."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from c_builds import compile, needs_c

HERE = Path(__file__).resolve().parent
MEGA = 1 << 20
GROUPS = "/sys/fs/cgroup"

pytestmark = [
    needs_c,
    pytest.mark.skipif(
        not sys.platform.startswith("linux"), reason="only Linux has such files, and preloads"
    ),
]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "files_elsewhere.so"
    compile("-O1", "-shared", "-fPIC", HERE / "files_elsewhere.c", "-o", path, "-ldl")
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


def group(folder, limit, usage, stat=""):
    """A control group of version 2."""
    return {
        f"{GROUPS}{folder}/memory.max": f"{limit}\n",
        f"{GROUPS}{folder}/memory.current": f"{usage * MEGA}\n",
        f"{GROUPS}{folder}/memory.stat": stat,
    }


def test_the_machine_sets_the_limit_where_there_is_no_group(available):
    assert available(machine(700)) == 700


def test_where_the_machine_says_nothing_all_its_memory_counts(available):
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGESIZE") / MEGA
    assert available({}) == pages


def test_the_narrowest_group_counts(available):
    files = machine(900) | {"/proc/self/cgroup": "0::/outer/inner\n"}
    files |= group("/outer/inner", 500 * MEGA, 100)
    assert available(files) == 400
    assert available(group("/outer", 600 * MEGA, 350)) == 250
    assert available(group("", 800 * MEGA, 790)) == 10
    assert available(group("", "max", 790)) == 250


def test_a_group_may_be_over_its_limit(available):
    files = machine(900) | {"/proc/self/cgroup": "0::/one\n"} | group("/one", 5 * MEGA, 6)
    assert available(files) == 0


def test_pages_of_files_can_be_dropped(available):
    stat = f"anon 7\nactive_file_other 9\ninactive_file {30 * MEGA}\nactive_file {4 * MEGA}\n"
    files = machine(900) | {"/proc/self/cgroup": "0::/one\n"}
    assert available(files | group("/one", 500 * MEGA, 200, stat)) == 334


def test_groups_of_version_1_are_no_groups_of_version_2(available):
    files = machine(900) | {"/proc/self/cgroup": "2:memory:/one\n1:name=systemd:/one\n3::/one\n"}
    files |= group("/one", 500 * MEGA, 200)
    assert available(files) == 900
    assert available({"/proc/self/cgroup": "1:name=systemd:/\n0::/one\n"}) == 300
    assert available({"/proc/self/cgroup": ""}) == 900


def test_the_memory_group_of_version_1_counts(available):
    folder = f"{GROUPS}/memory"
    files = machine(900) | {"/proc/self/cgroup": "4:memory:/\n"} | {
        f"{folder}/memory.limit_in_bytes": f"{300 * MEGA}\n",
        f"{folder}/memory.usage_in_bytes": f"{250 * MEGA}\n",
        f"{folder}/memory.stat": f"inactive_file 1\ntotal_inactive_file {20 * MEGA}\n",
    }
    assert available(files) == 70
