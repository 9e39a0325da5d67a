# SPDX-License-Identifier: BSD-3-Clause
"""Sources and compiler flags of the extension; everything else is in pyproject.toml.

HS_DEBUG=1 builds with assertions and without optimisation, HS_SANITIZE=1 with the address and
undefined-behaviour sanitizers, HS_WERROR=1 turns warnings into errors.
"""

import os
import sys
from glob import glob

import numpy
from setuptools import Extension, setup

if sys.platform == "win32":
    compile_args = ["/std:c11", "/O2", "/fp:precise"]
    link_args = []
    include_dirs = [numpy.get_include()]
else:
    compile_args = [
        "-std=c11",
        "-O3",
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
    include_dirs = []
    compile_args += ["-isystem", numpy.get_include()]  # no warnings of NumPy's headers
    if os.environ.get("HS_WERROR"):
        compile_args += ["-Werror"]
    if os.environ.get("HS_DEBUG"):
        compile_args += ["-O0", "-g3", "-UNDEBUG"]
    if os.environ.get("HS_SANITIZE"):
        compile_args += ["-g", "-UNDEBUG", "-fsanitize=address,undefined,float-cast-overflow"]
        link_args += ["-fsanitize=address,undefined"]

sources = [
    source
    for folder in ("core/*", "kernels", "binding")
    for source in sorted(glob(f"csrc/{folder}/*.c"))
]
headers = sorted(glob("csrc/**/*.h", recursive=True))

setup(
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
