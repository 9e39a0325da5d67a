# SPDX-License-Identifier: BSD-3-Clause
"""The table of functions for other extension modules: halfshell_capi.h and _core._C_API."""

import ctypes
import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

import halfshell as hs
from c_builds import C_COMPILER, STRICT, build_extension, compile, needs_c
from checkout import CSRC, ROOT, SUPPORT
from halfshell import _core

PROBE = SUPPORT / "probe_capi.c"
CYTHON = ROOT / "examples" / "cython"
NAME = b"halfshell._core._C_API"

SPEC = importlib.util.spec_from_file_location("capi_layout", ROOT / "tests" / "capi_layout.py")
capi_layout = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(capi_layout)

PyCapsule_New = ctypes.pythonapi.PyCapsule_New
PyCapsule_New.restype = ctypes.py_object
PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
PyCapsule_GetPointer = ctypes.pythonapi.PyCapsule_GetPointer
PyCapsule_GetPointer.restype = ctypes.c_void_p
PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]


class Table(ctypes.Structure):
    """A hs_capi, its functions as addresses."""

    _fields_ = [
        ("abi_version", ctypes.c_uint32),
        ("size", ctypes.c_uint32),
        *((name, ctypes.c_void_p) for name in capi_layout.table()),
    ]


def table():
    return Table.from_address(PyCapsule_GetPointer(_core._C_API, NAME))


def load(path):
    """A module from a copy of its file, so that it is initialised anew each time."""
    folder = tempfile.mkdtemp(dir=path.parent)
    path = Path(shutil.copy(path, folder))
    spec = importlib.util.spec_from_file_location(path.name.split(".")[0], path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def probe(tmp_path_factory):
    """The probe, compiled as C11: the path of the module."""
    folder = tmp_path_factory.mktemp("probe")
    return build_extension(folder, PROBE, "-std=c11", *STRICT, "-Wstrict-prototypes")


def test_the_table_has_every_function_of_the_header():
    assert sorted(capi_layout.declared()) == sorted(capi_layout.table())
    assert len(capi_layout.table()) >= 40


def test_the_table_says_how_it_is_laid_out():
    assert table().abi_version == capi_layout.version()
    assert table().size == ctypes.sizeof(Table)
    addresses = [getattr(table(), name) for name in capi_layout.table()]
    assert all(addresses) and len(set(addresses)) == len(addresses)


@needs_c
def test_compiled_modules_would_not_misread_it():
    """tests/capi_layout.py says what to do where this fails."""
    kept, now = capi_layout.read(), capi_layout.layout()
    assert kept["version"] == now["version"]
    assert capi_layout.changes(kept, now) == []
    assert kept == now


def test_a_changed_layout_is_noticed():
    kept = capi_layout.read()
    numbers = {**kept["numbers"], "hs_options.want": 0}
    functions = kept["functions"]
    assert len(capi_layout.changes(kept, {**kept, "numbers": numbers})) == 1
    assert len(capi_layout.changes(kept, {**kept, "functions": functions[::-1]})) == 1
    assert len(capi_layout.changes(kept, {**kept, "functions": functions[:-1]})) == 1
    more = {**kept, "functions": [*functions, "new"], "numbers": {**kept["numbers"], "NEW": 1}}
    assert capi_layout.changes(kept, more) == []


def test_functions_can_be_called_through_ctypes():
    version = ctypes.CFUNCTYPE(ctypes.c_int)(table().version)()
    assert hs.__version__ == f"{version // 10000}.{version // 100 % 100}.{version % 100}"
    text = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_int)(table().status_text)
    assert text(0) == b"success"
    assert text(-1) == text(10**6) == b"unknown status"
    names = (ctypes.c_char_p * 8)()
    kernel_names = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int)
    n = kernel_names(table().kernel_names)(ctypes.byref(names), 8)
    assert [name.decode() for name in names[:n]] == hs.kernels()
    for free in ("array_free", "pairs_free", "stream_free", "cells_free", "verlet_free"):
        ctypes.CFUNCTYPE(None, ctypes.c_void_p)(getattr(table(), free))(None)


@needs_c
def test_a_module_counts_the_same_pairs(probe, rng):
    module = load(probe)
    points = rng.random((2000, 3))
    assert module.count(points, 3, 0.1) == hs.count_pairs(points, 0.1)
    assert module.count(points, 2, 0.1) == hs.count_pairs(points.reshape(-1, 2), 0.1)
    with pytest.raises(ValueError, match="cutoff must be finite"):
        module.count(points, 3, float("nan"))


@needs_c
def test_a_module_of_cxx_does_too(tmp_path, rng):
    compiler = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    source = tmp_path / "probe_capi.cpp"
    shutil.copy(PROBE, source)
    module = load(build_extension(tmp_path, source, "-std=c++17", *STRICT, compiler=compiler))
    points = rng.random((500, 3))
    assert module.count(points, 3, 0.2) == hs.count_pairs(points, 0.2)


def pretend(monkeypatch, name=NAME, **changed):
    """Another capsule in place of ours; the copy of the table lives as long as the test."""
    copy = Table.from_buffer_copy(table())
    for member, value in changed.items():
        setattr(copy, member, value)
    capsule = PyCapsule_New(ctypes.addressof(copy), name, None)
    monkeypatch.setattr(_core, "_C_API", capsule)
    return copy


@needs_c
def test_another_abi_version_is_refused(probe, monkeypatch):
    for version in (0, capi_layout.version() + 1, 2**32 - 1):
        copy = pretend(monkeypatch, abi_version=version)
        wanted = capi_layout.version()
        message = rf"for version {wanted} .* has version {version}: compile the module again"
        with pytest.raises(ImportError, match=message):
            load(probe)
        assert copy.abi_version == version


@needs_c
def test_an_older_core_that_lacks_functions_is_refused(probe, monkeypatch):
    for size in (0, 8, ctypes.sizeof(Table) - 1):
        copy = pretend(monkeypatch, size=size)
        with pytest.raises(ImportError, match=r"halfshell \d+\.\d+ or later.*update halfshell"):
            load(probe)
        assert copy.size == size


@needs_c
def test_a_newer_core_with_more_functions_is_taken(probe, monkeypatch):
    copy = pretend(monkeypatch, size=ctypes.sizeof(Table) + 8)
    assert load(probe).version() > 0
    assert copy.abi_version == capi_layout.version()


@needs_c
def test_what_is_no_such_capsule_is_refused(probe, monkeypatch):
    copy = pretend(monkeypatch, name=b"another")
    with pytest.raises(AttributeError, match="_C_API"):
        load(probe)
    monkeypatch.setattr(_core, "_C_API", None)
    with pytest.raises(AttributeError, match="_C_API"):
        load(probe)
    monkeypatch.delattr(_core, "_C_API")
    with pytest.raises(AttributeError):
        load(probe)
    assert copy.abi_version == capi_layout.version()


def in_fresh_interpreter(folder, script):
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@needs_c
def test_the_table_outlives_the_modules(probe):
    script = """
import gc, json, struct, sys
import probe_capi
points = struct.pack("4d", 0.0, 0.5, 1.0, 5.0)
before = probe_capi.count(points, 1, 1.0)
for name in [name for name in sys.modules if name.split(".")[0] == "halfshell"]:
    del sys.modules[name]
gc.collect()
print(json.dumps([before, probe_capi.count(points, 1, 1.0)]))
"""
    assert in_fresh_interpreter(probe.parent, script) == [3, 3]


@needs_c
def test_without_halfshell_it_is_an_import_error(probe):
    script = """
import json, sys
sys.modules["halfshell"] = None
try:
    import probe_capi
except ImportError as error:
    print(json.dumps(str(error)))
"""
    assert "halfshell" in in_fresh_interpreter(probe.parent, script)


@needs_c
def test_python_must_be_included_before(tmp_path):
    source = tmp_path / "alone.c"
    source.write_text('#include "halfshell_capi.h"\n')
    with pytest.raises(AssertionError, match=r"include Python.h before halfshell_capi.h"):
        compile("-fsyntax-only", f"-I{CSRC}", source, compiler=C_COMPILER)


@pytest.mark.slow
@needs_c
def test_the_cython_example_builds_and_agrees(tmp_path, rng):
    if importlib.util.find_spec("Cython") is None:
        pytest.skip("Cython is not installed: pip install cython")
    folder = tmp_path / "cython"
    shutil.copytree(CYTHON, folder, ignore=shutil.ignore_patterns("build", "*.c", "*.so"))
    command = [sys.executable, "setup.py", "build_ext", "--inplace"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = folder.glob("lennard_jones*.so")
    module = load(built)
    lattice = np.stack(np.meshgrid(*[np.arange(8.0)] * 3), axis=-1).reshape(-1, 3)
    points = lattice * 1.2 + 0.1 * rng.random(lattice.shape)
    lengths = np.full(3, 9.6)
    total, n = module.energy(points, 2.5, lengths)
    d = hs.pairs(points, 2.5, box=lengths, quantities="d")
    assert n == len(d)
    assert np.isclose(total, (4.0 * (d**-12 - d**-6)).sum(), rtol=1e-12)
    assert module.energy(points[::-2, ::-1], 2.5, lengths)[1] == hs.count_pairs(
        points[::-2, ::-1], 2.5, box=lengths
    )
    assert module.energy(np.empty((0, 2)), 1.0, np.ones(2)) == (0.0, 0)
    with pytest.raises(ValueError, match="periodic box vectors must be linearly independent"):
        module.energy(points, 1.0, np.zeros(3))
    with pytest.raises(ValueError, match=r"d from 1 to 8, got d = 9"):
        module.energy(np.zeros((2, 9)), 1.0, np.ones(9))
