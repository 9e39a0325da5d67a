# SPDX-License-Identifier: BSD-3-Clause
"""NumPy files of the command line: what they promise is refused before it is unpacked."""

import io
import tracemalloc
import zipfile

import numpy as np
import pytest

from halfshell._cli.errors import InputError
from halfshell._cli.files import read_scene
from halfshell._convert import memory

POINTS = np.random.default_rng(5).random((60, 3))


def header(shape, descr="<f8", version=(1, 0), padding=0):
    """The start of a .npy file that says it has such an array."""
    text = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape!r}, }}".encode()
    text += b" " * padding + b"\n"
    length = len(text).to_bytes(2 if version[0] == 1 else 4, "little")
    return b"\x93NUMPY" + bytes(version) + length + text


def npz_of(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as part:
                for block in content if not isinstance(content, bytes) else [content]:
                    part.write(block)
    return str(path)


def array_bytes(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def refused(path):
    """What is said of a file; reading it takes no more than some megabytes."""
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            read_scene(str(path))
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
    return str(caught.value)


@pytest.fixture
def little_memory(monkeypatch):
    """A machine with 90 MB left."""
    class Core:
        @staticmethod
        def available_memory():
            return 90e6

    monkeypatch.setattr(memory, "_core", Core)


@pytest.mark.usefixtures("little_memory")
@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_small_files_of_large_arrays_are_refused_before_they_are_unpacked(tmp_path, version):
    n = 2_000_000  # 48 MB, twice 96
    path = npz_of(
        tmp_path / "zeros.npz", points=[header((n, 3), version=version), *[bytes(240_000)] * 200]
    )
    assert (tmp_path / "zeros.npz").stat().st_size < 100_000
    line = refused(path)
    assert line.startswith(f"{path}: 'points' of shape (2000000, 3) and dtype float64")
    assert "would take 0.096 GB, more than is available" in line


@pytest.mark.usefixtures("little_memory")
def test_npy_files_that_do_not_fit_are_refused_by_their_header(tmp_path):
    path = tmp_path / "zeros.npy"
    with open(path, "wb") as stream:
        stream.write(header((2_000_000, 3)))
        stream.truncate(stream.tell() + 48_000_000)
    assert "would take 0.096 GB" in refused(path)


PROMISES = [
    ((2**30, 3), "is cut off: that is 25,769,803,776 bytes, there are"),
    ((61, 3), "is cut off"),
    ((2**31, 1), "fewer than 2**31 points"),
    ((2**62, 2**62), "with d <= 8"),
    ((4, 9), "points have shape (4, 9); they must be (n, d) with d <= 8"),
    ((2**62,), "they must be (n, d)"),
    ((2, 2, 2), "they must be (n, d)"),
]


def test_headers_that_promise_too_much_are_refused(tmp_path):
    for shape, words in PROMISES:
        content = header(shape) + POINTS.tobytes()
        (tmp_path / "file.npy").write_bytes(content)
        npz_of(tmp_path / "file.npz", points=content)
        assert words in refused(tmp_path / "file.npy") and words in refused(tmp_path / "file.npz")


@pytest.mark.parametrize("kind", ["npy", "npz"])
def test_long_headers_are_refused(tmp_path, kind):
    long = header((1, 3), version=(2, 0), padding=50_000_000)
    path = tmp_path / f"file.{kind}"
    if kind == "npy":
        path.write_bytes(long[:1000])  # says that it has them
    else:
        npz_of(path, points=long)
        del long
    assert "reading array header, expected 50000060 bytes" in refused(path)


def test_boxes_are_small(tmp_path):
    points = array_bytes(POINTS)
    box = [header((5000, 3000)), *[bytes(10**6)] * 120]
    path = npz_of(tmp_path / "box.npz", points=points, box=box)
    assert "'box' has shape (5000, 3000), more than a box has" in refused(path)
    path = npz_of(tmp_path / "flags.npz", points=points, periodic=header((2**40,), "|b1"))
    assert "'periodic' has shape" in refused(path)


def test_only_what_is_used_is_unpacked(tmp_path):
    path = npz_of(
        tmp_path / "more.npz", points=array_bytes(POINTS), other=[header((2**40, 3))],
        velocities=[header((10**7,)), *[bytes(10**6)] * 80],
    )  # fmt: skip
    tracemalloc.start()
    scene = read_scene(path)
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()
    assert np.array_equal(scene.points, POINTS) and scene.box is None
    with zipfile.ZipFile(tmp_path / "text.npz", "w") as archive:
        archive.writestr("points", "no array")
        archive.writestr("what\x1b[31m.npy", b"")
    assert r"no array 'points' (it holds points, what\x1b[31m)" in refused(tmp_path / "text.npz")


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_every_version_of_the_format_is_read(tmp_path, version):
    content = io.BytesIO()
    np.lib.format.write_array(content, POINTS, version=version)
    (tmp_path / "file.npy").write_bytes(content.getvalue())
    assert np.array_equal(read_scene(str(tmp_path / "file.npy")).points, POINTS)
    path = npz_of(tmp_path / "file.npz", points=content.getvalue())
    assert np.array_equal(read_scene(path).points, POINTS)
