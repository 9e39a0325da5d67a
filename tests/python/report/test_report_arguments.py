# SPDX-License-Identifier: BSD-3-Clause
"""`report` refuses what is no list of names, no number, no kernel, and names the argument."""

import numpy as np
import pytest

import halfshell as hs
from halfshell import cli
from halfshell_report import report

PATIENCE = "^patience must be a positive number of seconds, got"


class Gone:
    """A sequence that raises an error of its own."""

    def __len__(self):
        return 2

    def __getitem__(self, k):
        raise KeyError("gone")


@pytest.mark.parametrize("name", ["scenes", "methods", "peers"])
def test_what_is_no_sequence_of_names(name):
    no_names = [5, 5.0, object(), np.zeros((2, 2)), [1], [["x"]], "x", b"x", Gone(), [10**5000]]
    for value in no_names:
        options = {"scenes": [], name: value}
        with pytest.raises(TypeError, match=rf"^{name} must be a sequence of names") as refused:
            report(**options)
        assert "\n" not in str(refused.value) and len(str(refused.value)) < 300
        if isinstance(value, Gone):
            assert isinstance(refused.value.__cause__, KeyError)


def test_patience_that_is_no_number():
    for value in ("x", [1], np.zeros((2, 2)), 1j, object()):
        with pytest.raises(TypeError, match=PATIENCE):
            report([], patience=value)


def test_sizes_are_strings():
    for value in (5, None, [1], np.zeros((2, 2))):
        with pytest.raises(TypeError, match=r"^size must be a string"):
            report([], size=value)


def test_an_unknown_kernel_is_refused_before_any_scene(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(hs._core, "default_kernel", lambda: "nonsense")
    arguments = ["report", "--size", "small", "--scenes", "slab", "--methods", "exact"]
    status = cli.main([*arguments, "--peers", "none", "-o", str(tmp_path / "out")])
    out, err = capsys.readouterr()
    assert status == 2 and out == "" and not (tmp_path / "out").exists()
    assert err.startswith("halfshell: error: HALFSHELL_KERNEL=nonsense: is not a kernel")
    assert err.count("\n") == 1
    with pytest.raises(ValueError, match=r"^HALFSHELL_KERNEL=nonsense: is not a kernel"):
        report(["slab"], methods=["exact"], size="small")
