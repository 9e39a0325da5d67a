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

    def limit(self, folder, limit, usage, inactive=0, active=0):
        """A group of version 2, or of version 1 where the folder ends with "!"."""
        if folder.endswith("!"):
            names = "limit_in_bytes", "usage_in_bytes", "total_"
            rest = "inactive_file 99999999999\nactive_file 99999999999\n"
        else:
            names = "max", "current", ""
            rest = "anon 1\ninactive_anon 5\n"
        folder = folder.removesuffix("!")
        self.write(f"{folder}/memory.{names[0]}", f"{limit}\n")
        self.write(f"{folder}/memory.{names[1]}", f"{usage}\n")
        files = "".join(f"{names[2]}{kind}_file {size}\n"
                        for kind, size in (("inactive", inactive), ("active", active)))  # fmt: skip
        self.write(f"{folder}/memory.stat", rest + files)

    def left(self):
        return _core.group_memory(str(self.root))


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path)


TOP, ONE = "/sys/fs/cgroup", "/sys/fs/cgroup/memory"
JOBS = "9:name=systemd:/\n4:cpu,memory:/jobs/one\n1:cpuset:/other\n0::/\n"
ABOVE = [(f"{ONE}!", NO_LIMIT_V1, 5000), (f"{ONE}/jobs/one!", 400, 100, 20, 30),
         (f"{ONE}/other!", 1, 0)]  # fmt: skip
ODD = "35 31 0:32 / /odd\\040place/with\\134memory rw - cgroup cgroup rw,hugetlb,memory\n"
FIELDS = "35 31 0:32 / /a\\4b rw,label=odd- master:1 - cgroup cgroup rw,memory\n"
DOCKER = V1_MEMORY.replace("0:32 /", "0:32 /docker/abc")
IN_DOCKER = [(f"{ONE}!", 400, 100), (f"{ONE}/inner!", 350, 90)]
LONG = V2.replace("rw,nosuid", "rw," + "x" * 20000) + V2

#: What is said of groups and mounts, limits in megabytes, and the megabytes that are left.
GROUPS = {
    "no groups": ("", "", [], math.inf),
    "nowhere but at the top": ("0::/\n", None, [(TOP, 400, 100)], 300),
    "1: above it": (JOBS, V1_CPU + V1_MEMORY, [*ABOVE, (f"{ONE}/jobs!", 1000, 900, 50)], 150),
    "1: in the usual place": (JOBS, None, [*ABOVE, (f"{ONE}/jobs!", 1000, 900, 50)], 150),
    "1: itself": (JOBS, V1_MEMORY, [*ABOVE, (f"{ONE}/jobs!", 1000, 150)], 350),
    "1: the top": (JOBS, V1_MEMORY, [*ABOVE, (f"{ONE}!", 300, 100)], 200),
    "1: where the mount says": (
        "4:hugetlb,memory:/jobs\n", V1_CPU + ODD,
        [("/odd place/with\\memory/jobs!", 400, 100), (f"{ONE}!", 0.1, 0)], 300,
    ),
    "1: fields of a mount": ("4:memory:/jobs\n", FIELDS, [("/a\\4b/jobs!", 400, 100)], 300),
    "1: the largest limit": ("4:memory:/\n", V1_MEMORY, [(f"{ONE}!", NO_LIMIT_V1, 5000)], math.inf),
    "2: none": ("0::/user/job\n", V2, [(f"{TOP}/user/job", "max", 100)], math.inf),
    "2: above it": (
        "0::/user/job\n", V2,
        [(f"{TOP}/user/job", "max", 100), (f"{TOP}/user", 600, 250, 20, 5)], 375,
    ),
    "2: itself, in the usual place": (
        "0::/user/job\n", None,
        [(f"{TOP}/user/job", 400, 100), (f"{TOP}/user", 600, 250, 20, 5)], 300,
    ),
    "1 is not 2": (
        "2:memory:/one\n1:name=systemd:/one\n3::/one\n", V2, [(f"{TOP}/one", 400, 100)], math.inf,
    ),
    "2 among 1": ("1:name=systemd:/\n0::/one\n3:cpu:/\n", V2, [(f"{TOP}/one", 400, 100)], 300),
    "hybrid, memory in 1": (
        "4:memory:/a/b\n0::/a/b\n", V1_CPU + V1_MEMORY + UNIFIED, [(f"{ONE}/a!", 400, 100)], 300,
    ),
    "hybrid, memory in 2": (
        "2:cpu:/x\n0::/a/b\n", V1_CPU + UNIFIED, [(f"{TOP}/unified/a", 400, 100)], 300,
    ),
    "both": (
        "4:memory:/a\n0::/b\n", V1_MEMORY + UNIFIED,
        [(f"{ONE}/a!", 400, 100), (f"{TOP}/unified/b", 500, 300)], 200,
    ),
    "container": ("4:memory:/docker/abc\n", DOCKER, IN_DOCKER, 300),
    "within a container": ("4:memory:/docker/abc/inner\n", DOCKER, IN_DOCKER, 260),
    "another container": ("4:memory:/docker/abcdef/inner\n", DOCKER, IN_DOCKER, 300),
    "outside of it": ("4:memory:/../other/inner\n", DOCKER, IN_DOCKER, 300),
    "gone": ("0::/jobs/one (deleted)\n", V2, [(f"{TOP}/jobs", 400, 100)], 300),
    "beyond the limit": ("0::/a\n", V2, [(f"{TOP}/a", 100, 130)], 0),
    "pages beyond the limit": ("0::/a\n", V2, [(f"{TOP}/a", 100, 10, 500)], 100),
    "long lines": ("0::/" + "a/" * 10000 + "\n", LONG, [(TOP, 400, 100)], 300),
    "no lines": ("no colons\n:::\n", "short\n1 2 3\n" + V2, [(TOP, 400, 100)], math.inf),
}  # fmt: skip


@pytest.mark.parametrize("name", GROUPS)
def test_what_groups_leave(tree, name):
    groups, mounts, limits, left = GROUPS[name]
    tree.process(groups, mounts)
    for folder, limit, *sizes in limits:
        limit = limit if limit in ("max", NO_LIMIT_V1) else int(limit * MB)
        tree.limit(folder, limit, *(size * MB for size in sizes))
    assert tree.left() == left * MB


def test_what_cannot_be_read_limits_nothing_but_a_known_limit_counts(tree):
    tree.process("0::/a\n", V2)
    tree.limit("/sys/fs/cgroup/a", 400 * MB, 100 * MB)
    for name in ("memory.stat", "memory.current"):
        file = tree.root / "sys/fs/cgroup/a" / name
        file.unlink()
        file.mkdir()  # opens, and cannot be read
    assert tree.left() == 400 * MB
    tree.write("/sys/fs/cgroup/a/memory.max", "nonsense\n")
    assert tree.left() == math.inf


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
