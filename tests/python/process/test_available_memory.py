# SPDX-License-Identifier: BSD-3-Clause
"""What control groups and the machine leave of the memory: made-up files stand in for Linux's."""

import math
import os
import subprocess
import sys

import pytest

from c_builds import compile, needs_c
from checkout import SUPPORT
from halfshell import _core

MB = 10**6
NO_LIMIT_V1 = 9223372036854771712

V2 = "31 23 0:28 / /sys/fs/cgroup rw,nosuid shared:4 - cgroup2 cgroup2 rw,nsdelegate\n"
V1_CPU = "32 31 0:29 / /sys/fs/cgroup/cpu rw - cgroup cgroup rw,cpu\n"
V1_MEMORY = "35 31 0:32 / /sys/fs/cgroup/memory rw,relatime - cgroup cgroup rw,memory\n"
UNIFIED = "41 31 0:38 / /sys/fs/cgroup/unified rw,relatime - cgroup2 cgroup2 rw\n"

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="paths of Linux")


class Tree:
    """Files of Linux below a folder."""

    def __init__(self, root):
        self.root = root

    def write(self, path, text):
        file = self.root / path.lstrip("/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file

    def process(self, groups, mounts=None):
        self.write("/proc/self/cgroup", groups)
        if mounts is not None:
            self.write("/proc/self/mountinfo", mounts)

    def v2(self, folder, limit, usage, inactive=0, active=0):
        self.write(f"{folder}/memory.max", f"{limit}\n")
        self.write(f"{folder}/memory.current", f"{usage}\n")
        files = f"inactive_file {inactive}\nactive_file {active}\n"
        self.write(f"{folder}/memory.stat", f"anon 1\ninactive_anon 5\n{files}")

    def v1(self, folder, limit, usage, inactive=0, active=0):
        self.write(f"{folder}/memory.limit_in_bytes", f"{limit}\n")
        self.write(f"{folder}/memory.usage_in_bytes", f"{usage}\n")
        self.write(f"{folder}/memory.stat",
                   "inactive_file 99999999999\nactive_file 99999999999\n"
                   f"total_inactive_file {inactive}\ntotal_active_file {active}\n")  # fmt: skip

    def left(self):
        return _core.group_memory(str(self.root))


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path)


def test_no_control_groups_are_no_limit(tree):
    assert tree.left() == math.inf
    tree.process("", "")
    assert tree.left() == math.inf


def test_where_no_file_tells_the_group_there_is_no_limit(tree):
    tree.process("0::/\n")
    tree.v2("/sys/fs/cgroup", 400 * MB, 100 * MB)
    assert tree.left() == 300 * MB
    (tree.root / "proc/self/cgroup").unlink()
    assert tree.left() == math.inf


@pytest.mark.parametrize("mounts", [V1_CPU + V1_MEMORY, None], ids=["mountinfo", "usual place"])
def test_version_1_counts_the_group_and_those_above_it(tree, mounts):
    tree.process("9:name=systemd:/\n4:cpu,memory:/jobs/one\n1:cpuset:/other\n0::/\n", mounts)
    top = "/sys/fs/cgroup/memory"
    tree.v1(top, NO_LIMIT_V1, 5000 * MB)
    tree.v1(f"{top}/jobs", 1000 * MB, 900 * MB, 50 * MB)
    tree.v1(f"{top}/jobs/one", 400 * MB, 100 * MB, 20 * MB, 30 * MB)
    tree.v1(f"{top}/other", 1, 0)
    assert tree.left() == 150 * MB
    tree.v1(f"{top}/jobs", 1000 * MB, 150 * MB)
    assert tree.left() == 350 * MB
    tree.v1(top, 300 * MB, 100 * MB)
    assert tree.left() == 200 * MB


def test_version_1_is_where_the_mount_says(tree):
    place = "/odd\\040place/with\\134memory"
    mounts = V1_CPU + f"35 31 0:32 / {place} rw - cgroup cgroup rw,hugetlb,memory\n"
    tree.process("4:hugetlb,memory:/jobs\n", mounts)
    tree.v1("/odd place/with\\memory/jobs", 400 * MB, 100 * MB)
    tree.v1("/sys/fs/cgroup/memory", 10, 0)
    assert tree.left() == 300 * MB


def test_lines_of_mountinfo_are_read_field_by_field(tree):
    mounts = "35 31 0:32 / /a\\4b rw,label=odd- master:1 - cgroup cgroup rw,memory\n"
    tree.process("4:memory:/jobs\n", mounts)
    tree.v1("/a\\4b/jobs", 400 * MB, 100 * MB)
    assert tree.left() == 300 * MB


def test_the_largest_limit_of_version_1_is_none(tree):
    tree.process("4:memory:/\n", V1_MEMORY)
    tree.v1("/sys/fs/cgroup/memory", NO_LIMIT_V1, 5000 * MB)
    assert tree.left() == math.inf


@pytest.mark.parametrize("mounts", [V2, None], ids=["mountinfo", "usual place"])
def test_version_2_counts_the_group_and_those_above_it(tree, mounts):
    tree.process("0::/user.slice/job\n", mounts)
    tree.v2("/sys/fs/cgroup/user.slice/job", "max", 100 * MB)
    assert tree.left() == math.inf
    tree.v2("/sys/fs/cgroup/user.slice", 600 * MB, 250 * MB, 20 * MB, 5 * MB)
    assert tree.left() == 375 * MB
    tree.v2("/sys/fs/cgroup/user.slice/job", 400 * MB, 100 * MB)
    assert tree.left() == 300 * MB


def test_groups_of_version_1_are_no_groups_of_version_2(tree):
    tree.v2("/sys/fs/cgroup/one", 400 * MB, 100 * MB)
    tree.process("2:memory:/one\n1:name=systemd:/one\n3::/one\n", V2)
    assert tree.left() == math.inf
    tree.process("1:name=systemd:/\n0::/one\n3:cpu:/\n", V2)
    assert tree.left() == 300 * MB


@pytest.mark.parametrize("memory_in", ["v1", "v2"])
def test_hybrid_setups_are_limited_by_the_hierarchy_that_has_the_memory(tree, memory_in):
    if memory_in == "v1":
        tree.process("4:memory:/a/b\n0::/a/b\n", V1_CPU + V1_MEMORY + UNIFIED)
        tree.v1("/sys/fs/cgroup/memory/a", 400 * MB, 100 * MB)
        (tree.root / "sys/fs/cgroup/unified/a/b").mkdir(parents=True)
    else:
        tree.process("2:cpu:/x\n0::/a/b\n", V1_CPU + UNIFIED)
        tree.v2("/sys/fs/cgroup/unified/a", 400 * MB, 100 * MB)
    assert tree.left() == 300 * MB


def test_both_versions_count_where_both_limit(tree):
    tree.process("4:memory:/a\n0::/b\n", V1_MEMORY + UNIFIED)
    tree.v1("/sys/fs/cgroup/memory/a", 400 * MB, 100 * MB)
    tree.v2("/sys/fs/cgroup/unified/b", 500 * MB, 300 * MB)
    assert tree.left() == 200 * MB


def test_containers_see_the_part_of_a_hierarchy_that_is_theirs(tree):
    # Without a namespace of its own, a container's group is named as the host names it.
    mounts = V1_MEMORY.replace("0:32 /", "0:32 /docker/abc")
    top = "/sys/fs/cgroup/memory"
    tree.v1(top, 400 * MB, 100 * MB)
    tree.v1(f"{top}/inner", 350 * MB, 90 * MB)
    tree.process("4:memory:/docker/abc\n", mounts)
    assert tree.left() == 300 * MB
    tree.process("4:memory:/docker/abc/inner\n", mounts)
    assert tree.left() == 260 * MB
    for elsewhere in ("/docker/abcdef/inner", "/", "/../other/inner"):
        tree.process(f"4:memory:{elsewhere}\n", mounts)
        assert tree.left() == 300 * MB
    tree.process("4:memory:/../inner\n", V1_MEMORY)
    assert tree.left() == 300 * MB


def test_groups_that_are_gone_leave_those_above_them(tree):
    tree.process("0::/jobs/one (deleted)\n", V2)
    tree.v2("/sys/fs/cgroup/jobs", 400 * MB, 100 * MB)
    assert tree.left() == 300 * MB


def test_usage_beyond_the_limit_leaves_nothing_and_pages_no_more_than_the_limit(tree):
    tree.process("0::/a\n", V2)
    tree.v2("/sys/fs/cgroup/a", 100 * MB, 130 * MB)
    assert tree.left() == 0
    tree.v2("/sys/fs/cgroup/a", 100 * MB, 10 * MB, 500 * MB)
    assert tree.left() == 100 * MB


def test_what_cannot_be_read_limits_nothing_but_a_known_limit_counts(tree):
    tree.process("0::/a\n", V2)
    tree.v2("/sys/fs/cgroup/a", 400 * MB, 100 * MB)
    for name in ("memory.stat", "memory.current"):
        file = tree.root / "sys/fs/cgroup/a" / name
        file.unlink()
        file.mkdir()  # opens, and cannot be read
    assert tree.left() == 400 * MB
    tree.write("/sys/fs/cgroup/a/memory.max", "nonsense\n")
    assert tree.left() == math.inf
    tree.process("no colons\n:::\n", "short\n1 2 3\n" + V2)
    assert tree.left() == math.inf


def test_long_lines_do_no_harm(tree):
    tree.process("0::/" + "a/" * 10000 + "\n", V2.replace("rw,nosuid", "rw," + "x" * 20000) + V2)
    tree.v2("/sys/fs/cgroup", 400 * MB, 100 * MB)
    assert tree.left() == 300 * MB


def test_this_process_has_no_more_than_its_groups_leave():
    assert 0 < _core.available_memory() < math.inf
    assert _core.group_memory("") > 0


# ---- the machine --------------------------------------------------------------------------------

MEGA = 1 << 20

preloaded = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="only Linux has such files, and preloads"
)


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


@needs_c
@preloaded
def test_where_the_machine_says_nothing_all_its_memory_counts(available):
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGESIZE") / MEGA
    assert available({}) == pages


@needs_c
@preloaded
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
