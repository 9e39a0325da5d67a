# SPDX-License-Identifier: BSD-3-Clause
"""halfshell.h without Python: compiled with a plain command, it finds what the package finds, and
flags that would change its arithmetic do not."""

import re
import shutil
import subprocess
import tomllib

import numpy as np
import pytest

import halfshell as hs
from c_builds import C_COMPILER, STRICT, compile, needs_c
from checkout import CSRC, ROOT
from halfshell import _core

DOCS = (ROOT / "docs/c-interface.md").read_text()
EXAMPLES = ROOT / "examples" / "c"
PLAIN = "-std=c11 -O0 -g1"
SANITIZE = f"{PLAIN} -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"

pytestmark = [pytest.mark.slow, needs_c]


def run(program, *arguments):
    """Its output; none of the programs may fail or write to stderr."""
    done = subprocess.run([str(program), *map(str, arguments)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def is_gcc():
    text = subprocess.run([C_COMPILER, "--version"], capture_output=True, text=True).stdout
    return "clang" not in text and "Free Software Foundation" in text


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """rdf, by the command of the documentation, but at -O0: at -O2 it takes half a minute."""
    program = tmp_path_factory.mktemp("plain") / "rdf"
    command = re.search(r"^cc .*$", DOCS, re.MULTILINE)[0]
    assert command.endswith(" -o rdf")
    command = command.removesuffix("-o rdf") + f"-O0 -o {program}"
    done = subprocess.run(command, cwd=ROOT, shell=True, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return program


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A folder with the library and the examples, by their Makefile. The examples have sanitizers,
    so that errors and leaks end a program; the core has tests of its own under them."""
    folder = tmp_path_factory.mktemp("built")
    source = folder / "empty.c"
    source.write_text("int main(void) { return 0; }\n")
    flags = SANITIZE.split()
    tried = subprocess.run([C_COMPILER, *flags, source, "-o", folder / "empty"])
    if tried.returncode != 0 or shutil.which("make") is None:
        pytest.skip("there is no make, or a compiler without sanitizers")
    command = ["make", "-s", "-j2", "-C", EXAMPLES, f"BUILD={folder}", f"CC={C_COMPILER}"]
    for flags, target in ((PLAIN, folder / "libhalfshell.a"), (SANITIZE, "all")):
        done = subprocess.run(
            [*command, f"CFLAGS={flags}", target], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    return folder


def crystal(cells):
    """The points of examples/c/rdf.c, bit for bit."""
    base = [(0.0, 0.0, 0.0), (0.5, 0.5, 0.0), (0.5, 0.0, 0.5), (0.0, 0.5, 0.5)]
    state, points = 1, []
    for cell in range(cells**3):
        at = (cell % cells, cell // cells % cells, cell // cells // cells)
        for corner in base:
            for k in range(3):
                state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
                points.append(at[k] + corner[k] + ((state >> 11) * 2.0**-53 - 0.5) * 0.125)
    return np.array(points).reshape(-1, 3)


@pytest.mark.parametrize(("cells", "r_max", "bins"), [(6, 2.2, 37), (9, 2.0, 40), (1, 1.5, 3)])
def test_rdf_by_a_plain_command_is_that_of_the_package(plain, cells, r_max, bins):
    rows = np.array([line.split() for line in run(plain, cells, r_max, bins).splitlines()])
    points, box = crystal(cells), [float(cells)] * 3
    expected = hs.rdf(points, r_max, bins=bins, box=box)
    counts = hs.pair_histogram(points, expected.edges, box=box)
    np.testing.assert_array_equal(rows[:, 2].astype(np.int64), counts)
    np.testing.assert_array_equal(expected.counts, counts)
    np.testing.assert_allclose(rows[:, 1].astype(float), expected.g, rtol=1e-11)
    np.testing.assert_allclose(rows[:, 0].astype(float), expected.r, atol=1e-6)


def test_rdf_of_threads_is_the_same_and_leaks_nothing(plain, built):
    arguments = (18, 1.2, 25)  # enough points for two threads
    assert run(built / "rdf", *arguments) == run(plain, *arguments)


@pytest.mark.parametrize("arguments", [("0",), ("x",), ("2", "nan"), ("2", "0"), ("2", "1", "0")])
def test_rdf_refuses_what_makes_no_sense(plain, arguments):
    done = subprocess.run([plain, *arguments], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("usage: rdf")


@pytest.mark.parametrize(("along", "cutoff"), [(10, 3), (7, 5), (3, 0), (1, 1)])
def test_pairs_of_a_lattice_are_decided_exactly(built, along, cutoff):
    """The cutoff is a shell of the lattice, and 0.1 is no binary number."""
    lines = run(built / "pairs", along, cutoff).splitlines()
    axis = 0.1 * np.arange(along)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    within = 0.1 * cutoff
    i, j, d = hs.pairs(points, within, quantities="ijd", sort=True)
    first = [f"pair {a} {b} {c:.17g}" for a, b, c in zip(i[:3], j[:3], d[:3])]
    around = hs.neighbors(points, within, queries=np.zeros((1, 3)))[0]
    assert lines[: len(first) + 1] == [f"pairs {len(i)}", *first]
    assert lines[-2] == " ".join(map(str, [f"neighbors {len(around)}:", *around[:5]]))
    assert lines[-1].startswith(f"visited {len(i)}, sum of squares ")
    assert np.isclose(float(lines[-1].split()[-1]), (d * d).sum(), rtol=1e-8)


def test_failures_are_reported_and_leak_nothing(built):
    for arguments, message in [
        (("3", "-1"), "pairs: cutoff must be finite and not negative, got -0.1\n"),
        (("3", "nan"), "pairs: cutoff must be finite and not negative, got "),
        (("0",), "usage: pairs"),
    ]:
        done = subprocess.run([built / "pairs", *arguments], capture_output=True, text=True)
        assert done.returncode == 1 and done.stderr.startswith(message)


def test_a_plain_core_has_every_kernel_and_the_version(built, tmp_path):
    source = tmp_path / "about.c"
    source.write_text(
        '#include "halfshell.h"\n#include <stdio.h>\n'
        "int main(void) {\n    const char *names[8];\n"
        "    const int n = hs_kernel_names(names, 8);\n"
        '    printf("%d %d", hs_version(), HS_VERSION);\n'
        '    for (int k = 0; k < n; k++) printf(" %s", names[k]);\n    return 0;\n}\n'
    )
    compile(
        *SANITIZE.split(), f"-I{CSRC}", source, "-o", tmp_path / "about",
        built / "libhalfshell.a", "-lm", "-lpthread",
    )
    header, core, *kernels = run(tmp_path / "about").split()
    assert header == core
    assert kernels == hs.kernels()


def test_the_example_of_the_documentation_runs(built, tmp_path):
    (first, _) = re.findall(r"```c\n(.*?)```", DOCS, re.DOTALL)
    source = tmp_path / "shortest.c"
    source.write_text(first)
    compile(
        *SANITIZE.split(), *STRICT, f"-I{CSRC}", source, "-o", tmp_path / "shortest",
        built / "libhalfshell.a", "-lm", "-lpthread",
    )
    assert run(tmp_path / "shortest") == "0 1 0.1\n"


def test_versions_are_in_step():
    macros = dict(re.findall(r"#define HS_VERSION_(\w+) (\d+)", (CSRC / "halfshell.h").read_text()))
    header = f"{macros['MAJOR']}.{macros['MINOR']}.{macros['PATCH']}"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert header == project["version"] == hs.__version__ == _core.build_info()["core"]


@pytest.mark.parametrize("standard", ["c11", "c17", "gnu11"])
@pytest.mark.parametrize("name", ["rdf.c", "pairs.c", "hard_disks.c"])
def test_examples_compile_without_a_warning(name, standard):
    compile(f"-std={standard}", *STRICT, "-fsyntax-only", f"-I{CSRC}", EXAMPLES / name)


#: Final positions of the first lines of hard_disks.c, on every machine.
DISKS, SPHERES = "16b635ef59eeaa97", "4839ee53e499b368"


def hard_disks(folder, *arguments):
    """What the program prints, by name."""
    done = subprocess.run(
        [folder / "hard_disks", *map(str, arguments)], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    return dict(line.split() for line in done.stdout.splitlines())


@pytest.mark.parametrize("storage", [0, 1, 2])
def test_hard_disks_never_overlap_and_have_one_trajectory(built, storage):
    found = hard_disks(built, 2, 16, 0.3, 640, 1, storage)
    assert (found["overlaps"], found["hash"]) == ("0", DISKS)
    # Henderson, Molecular Physics 30 (1975) 971: within 0.1 % at this packing.
    expected = (1 + 0.3**2 / 8) / (1 - 0.3) ** 2
    assert abs(float(found["Z"]) - expected) < 4 * float(found["error"]) < 0.3


def test_hard_spheres_have_the_pressure_of_carnahan_and_starling(built):
    found = hard_disks(built, 3, 8, 0.3, 1600)
    assert (found["overlaps"], found["hash"]) == ("0", SPHERES)
    expected = (1 + 0.3 + 0.3**2 - 0.3**3) / (1 - 0.3) ** 3
    assert abs(float(found["Z"]) - expected) < 4 * float(found["error"]) < 0.3


@pytest.mark.parametrize("header", ["halfshell.h", "halfshell_dynamic.h", "halfshell_nodes.h"])
def test_the_header_stands_alone(header):
    header = CSRC / header
    compile("-std=c11", *STRICT, "-Wstrict-prototypes", "-fsyntax-only", "-x", "c", header)
    compiler = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    compile("-std=c++17", *STRICT, "-fsyntax-only", "-x", "c++", header, compiler=compiler)


@pytest.mark.parametrize(
    "flags",
    [
        "-ffast-math", "-O2 -ffast-math -std=c11", "-ffinite-math-only",
        pytest.param("-Ofast", marks=pytest.mark.skipif(not is_gcc(), reason="of gcc")),
        *(
            pytest.param(flag, marks=pytest.mark.skipif(not is_gcc(), reason="of gcc"))
            for flag in (
                "-funsafe-math-optimizations", "-fno-signed-zeros", "-freciprocal-math",
                "-fsingle-precision-constant", "-std=c11 -ffp-contract=fast",
            )
        ),
    ],
)
def test_flags_that_break_the_arithmetic_are_refused(flags):
    with pytest.raises(AssertionError, match="-ffast-math and the like break them"):
        compile(*flags.split(), "-fsyntax-only", CSRC / "core" / "search" / "scan.c")


FUSED = """
#include "core/base/base.h"
#include <stdio.h>
int main(void) {
    volatile double x = 0x1.0000002p27, y = -0x1p54;
    printf("%d %.17g\\n", hs_rounds_products(), x * x + y);
    return 0;
}
"""


@pytest.mark.parametrize("flags", ["-O2", "-O2 -ffp-contract=fast", "-O3 -std=gnu11"])
def test_products_are_not_fused_or_it_is_noticed(tmp_path, flags):
    """With instructions that could fuse, and a compiler that was told to."""
    source = tmp_path / "fused.c"
    source.write_text(FUSED)
    able = ["-mfma"] if "avx2" in hs.kernels() else []
    compile(*flags.split(), *able, f"-I{CSRC}", source, "-o", tmp_path / "fused")
    rounds, value = run(tmp_path / "fused").split()
    rounded = float(value) == 2.0**28
    assert rounds == str(int(rounded))
    assert rounded or not is_gcc()
