# SPDX-License-Identifier: BSD-3-Clause
"""docs/drop-ins.md and benchmarks/drop_ins.py: what they show runs."""

import re
import subprocess
import sys

import pytest

from checkout import BENCHMARKS, ROOT


def test_examples_of_the_page_run():
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs/drop-ins.md").read_text(), re.DOTALL)
    assert len(blocks) > 1
    for block in blocks:
        exec(block, {})


@pytest.mark.slow
def test_the_benchmark_compares_equal_lists():
    command = [sys.executable, str(BENCHMARKS / "drop_ins.py"), "--points", "300", "--turns", "1"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ase.NeighborList" in done.stdout
