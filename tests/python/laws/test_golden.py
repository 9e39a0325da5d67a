# SPDX-License-Identifier: BSD-3-Clause
"""The results of fixed scenes are, bit for bit, what they were: `tests/golden.py`."""

import importlib.util

import pytest

import halfshell as hs
from checkout import TESTS

SOURCE = TESTS / "golden.py"
SPEC = importlib.util.spec_from_file_location("golden", SOURCE)
golden = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(golden)

SCENES = golden.scenes()
KEPT = golden.read()


def test_every_scene_has_its_entry():
    assert list(KEPT) == list(SCENES)


@pytest.mark.parametrize("name", SCENES)
def test_results_are_what_they_were(name):
    kept = KEPT[name]
    for kernel, threads in [(None, 2), (None, 4), *((kernel, 1) for kernel in hs.kernels())]:
        found = golden.hashes(SCENES[name], kernel=kernel, threads=threads)
        answer = found["pairs"], found["sorted"]
        assert answer == (kept["pairs"], kept["sorted"]), "the answer differs"
        assert found == kept, (
            "the order of unsorted results differs; if that was the purpose: "
            "tests/golden.py --write"
        )


def test_a_changed_answer_is_not_written_by_accident(tmp_path, monkeypatch, capsys):
    copy = tmp_path / "golden.json"
    name = "1-D"
    monkeypatch.setattr(golden, "FILE", copy)
    monkeypatch.setattr(golden, "scenes", lambda: {name: SCENES[name]})
    assert golden.main([]) == 1
    assert golden.main(["--write"]) == 0
    assert golden.main([]) == 0
    good = copy.read_text()
    copy.write_text(good.replace(KEPT[name]["unsorted"], "0" * 64))
    assert golden.main([]) == 1
    assert golden.main(["--write"]) == 0
    assert copy.read_text() == good
    bad = good.replace(KEPT[name]["sorted"], "0" * 64)
    copy.write_text(bad)
    assert golden.main(["--write"]) == 1
    assert copy.read_text() == bad
    assert golden.main(["--write-answers"]) == 0
    assert copy.read_text() == good
    assert golden.main(["--wrong"]) == 2
    assert "answer differs" in capsys.readouterr().out
