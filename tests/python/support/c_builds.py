# SPDX-License-Identifier: BSD-3-Clause
"""Compilers, and what the tests of the C interface build with them."""

import shlex
import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"]

C_COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_c = pytest.mark.skipif(C_COMPILER is None, reason="there is no C compiler that takes -I")


def compile(*arguments, compiler=C_COMPILER):
    """Run a compiler; its messages are those of the test that fails."""
    done = subprocess.run([compiler, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stderr


def build_extension(folder, source, *flags, compiler=C_COMPILER):
    """Compile a module `source.stem` into a folder, as its author would: with the headers of the
    installed package and of Python, and no library."""
    import halfshell as hs

    linking = shlex.split(sysconfig.get_config_var("LDSHARED"))[1:]
    target = Path(folder) / (source.stem + sysconfig.get_config_var("EXT_SUFFIX"))
    compile(
        *flags, "-fPIC", *linking, f"-I{hs.get_include()}", "-isystem",
        sysconfig.get_path("include"), source, "-o", target, compiler=compiler,
    )
    return target
