# SPDX-License-Identifier: BSD-3-Clause
"""A plain function makes and calls another one while one allocation after the other is refused.

CPython 3.12 and 3.13 crash here, in frame_dealloc, with no module but their own: where this ends by
a signal, Python code is not asked to go without memory, compiled functions are.
"""

import _testcapi


def inner(values, check=None):
    return check(values)


def outer(values, name="points", ndim=3):
    def check(shape):
        return [name, ndim, shape]

    return inner(values, check=check)


def refuse(nth, more):
    try:
        _testcapi.set_nomemory(nth, nth + more)
        outer([1])
    except MemoryError:
        pass
    finally:
        _testcapi.remove_mem_hooks()


for more in (1, 10**6):
    for nth in range(1, 100):
        refuse(nth, more)
