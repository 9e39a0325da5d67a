# SPDX-License-Identifier: BSD-3-Clause
"""Builds the Cython example: python setup.py build_ext --inplace

It needs halfshell, Cython and setuptools, and links nothing: the functions come from the installed
halfshell when the module is imported.
"""

from Cython.Build import cythonize
from setuptools import Extension, setup

import halfshell

setup(
    name="lennard-jones-example",
    ext_modules=cythonize(
        [
            Extension(
                "lennard_jones",
                ["lennard_jones.pyx"],
                include_dirs=[halfshell.get_include()],
            )
        ]
    ),
)
