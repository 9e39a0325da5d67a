# SPDX-License-Identifier: BSD-3-Clause
"""Sources and compiler flags of the extension; everything else is in pyproject.toml.

HS_DEBUG=1 builds with assertions and without optimisation, HS_SANITIZE=1 with the address and
undefined-behaviour sanitizers, HS_WERROR=1 turns warnings into errors.
"""

import os
import shlex
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from glob import glob

import numpy
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

# -O3 without what takes much room and gains next to nothing here: copies of functions and loops,
# and long loops written out. Over 25 kinds of search it takes 1.01 of the time, and the compressed
# library 0.84 of the size. Loops are aligned: their speed is not that of what precedes them.
smaller = [
    "-fno-ipa-cp-clone",
    "-fno-unswitch-loops",
    "-fno-split-loops",
    "-fno-version-loops-for-strides",
    "--param=max-completely-peel-times=6",
    "--param=max-completely-peeled-insns=60",
    "--param=max-inline-insns-auto=15",
    "-falign-loops=32",
    "-fno-align-jumps",
    "-fno-align-labels",
    "-fno-asynchronous-unwind-tables",  # no exception passes through: callbacks must return
    "-fno-unwind-tables",
]

# Structs of up to 512 bytes are cleared and copied by plain stores, larger ones by memset and
# memcpy. By itself GCC takes rep stos and rep movs on x86, which start slowly. Calls with few
# points take 0.95 of the time, with 1e5 points 0.97.
stores = [
    "-mmemset-strategy=unrolled_loop:512:noalign,libcall:-1:noalign",
    "-mmemcpy-strategy=unrolled_loop:512:noalign,libcall:-1:noalign",
]
# What runs once a call, not once a point or pair, is compiled at -O2: three quarters of its size.
once_a_call = ("/binding/", "/api/", "/connectivity/", "/levels/", "/lattice.c", "/scene.c")
compiler = os.environ.get("CC") or sysconfig.get_config_var("CC") or ""


def accepted(flags):
    """The flags, or none if the compiler does not take them, as others than GCC on Linux."""
    if not sys.platform.startswith("linux"):
        return []
    command = [*shlex.split(compiler), *flags, "-Werror", "-fsyntax-only", "-x", "c", os.devnull]
    try:
        tried = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True)
    except OSError:
        return []  # there is no such compiler: setuptools says so
    return flags if tried.returncode == 0 else []


if sys.platform == "win32":
    compile_args = ["/std:c11", "/O2", "/fp:precise"]
    link_args = []
    include_dirs = [numpy.get_include()]
else:
    compile_args = [
        "-std=c11",
        "-O3",
        *accepted(smaller),
        *accepted(stores),
        "-g0",
        "-ffp-contract=off",
        "-fvisibility=hidden",
        "-pthread",
        "-Wall",
        "-Wextra",
        "-Wshadow",
        "-Wstrict-prototypes",
        "-Wmissing-prototypes",
    ]
    link_args = ["-pthread"]
    if sys.platform.startswith("linux") and not {"HS_DEBUG", "HS_SANITIZE"} & set(os.environ):
        link_args += ["-Wl,--strip-all"]  # of names that only a debugger reads
    include_dirs = []
    compile_args += ["-isystem", numpy.get_include()]  # no warnings of NumPy's headers
    if os.environ.get("HS_WERROR"):
        compile_args += ["-Werror"]
    if os.environ.get("HS_SANITIZE"):
        # They find the same at -O1, which is compiled in half the time.
        compile_args += ["-O1", "-g1", "-UNDEBUG"]
        compile_args += ["-fsanitize=address,undefined,float-cast-overflow"]
        compile_args += ["-fno-sanitize-recover=all"]  # whatever they find ends the process
        compile_args += ["-fno-wrapv"]  # which Python's own flags hide overflow with
        link_args += ["-fsanitize=address,undefined"]
    if os.environ.get("HS_DEBUG"):
        compile_args += ["-O0", "-g3", "-UNDEBUG"]


class BuildOnAllCores(build_ext):
    """Compiles the sources of the extension side by side, the largest first."""

    def build_extensions(self):
        compile_all = self.compiler.compile

        def compile_each(sources, *arguments, **options):
            def one(source):
                level = "-O2" if any(part in source for part in once_a_call) else "-O3"
                flags = [level if flag == "-O3" else flag for flag in options["extra_postargs"]]
                return compile_all([source], *arguments, **{**options, "extra_postargs": flags})[0]

            largest_first = sorted(sources, key=os.path.getsize, reverse=True)
            with ThreadPoolExecutor(cores()) as pool:
                made = dict(zip(largest_first, pool.map(one, largest_first)))
            return [made[source] for source in sources]

        if hasattr(self.compiler, "initialize") and not getattr(self.compiler, "initialized", True):
            self.compiler.initialize()  # of MSVC, once and not by each thread
        self.compiler.compile = compile_each
        super().build_extensions()


def cores():
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


sources = [
    source
    for folder in ("core/*", "kernels", "binding")
    for source in sorted(glob(f"csrc/{folder}/*.c"))
]
headers = sorted(glob("csrc/**/*.h", recursive=True))

setup(
    cmdclass={"build_ext": BuildOnAllCores},
    ext_modules=[
        Extension(
            "halfshell._core",
            sources=sources,
            depends=headers,
            include_dirs=include_dirs,
            extra_compile_args=compile_args,
            extra_link_args=link_args,
        )
    ]
)
