# SPDX-License-Identifier: BSD-3-Clause
"""Function pointers of all sorts and the data that they are called with, as addresses.

Nothing of scipy, numba or cffi is imported here: an object of theirs says what it is, and who has
one has the package. Types are compared as far as the object tells them.
"""

from __future__ import annotations

import ctypes
import importlib
import re
import sys
from _ctypes import CFuncPtr
from dataclasses import dataclass
from typing import Any

import numpy as np

from halfshell._convert.foreign import is_a, kind_of, shown, told, whole_number

EXPECTED = "int (int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)"

# The same as kind and bytes; each argument in all the forms that are taken.
_RESULT = "i4"
_ARGUMENTS = (("i8",), ("i8",), ("i4*", "void*"), ("f8*", "void*"), ("f8",), ("pointer",))

_LONG = f"i{ctypes.sizeof(ctypes.c_long)}"
_POINTER_SIZED = f"i{ctypes.sizeof(ctypes.c_void_p)}"
_C_TYPES = {
    "int": "i4", "int32_t": "i4", "int32": "i4", "intc": "i4", "signed int": "i4",
    "long": _LONG, "long int": _LONG,
    "int64_t": "i8", "int64": "i8", "longlong": "i8", "long long": "i8", "long long int": "i8",
    "ssize_t": _POINTER_SIZED, "Py_ssize_t": _POINTER_SIZED, "ptrdiff_t": _POINTER_SIZED,
    "intptr_t": _POINTER_SIZED, "npy_intp": _POINTER_SIZED,
    "double": "f8", "float64": "f8", "float64_t": "f8", "void": "void",
}

_PYTHON_CALLS = 4  # ctypes: functions that must be called with Python's lock
_NATIVE = f"__ctype_{sys.byteorder[0]}e__"  # ctypes: the type as this machine has it
_MOST_ADDRESS = 2 * sys.maxsize + 1


@dataclass(frozen=True)
class Target:
    """What the core is to call: the address of a function, and that of its data."""

    function: int
    user: int = 0
    keeps: object = None  # alive as long as this is


def target_of(callback: Any, user_data: Any) -> Target | None:
    """A compiled function; None for a Python callable.

    TypeError for what cannot be called, or would be called with the wrong arguments.
    """
    if is_a(callback, tuple) and _is_from(callback, "scipy"):
        return _of_low_level(callback, user_data)
    user, keeps = _address_of_data(user_data)
    if _is_from(callback, "numba") and hasattr(callback, "_sig") and hasattr(callback, "address"):
        _check(f"{callback._sig.return_type} ({', '.join(map(str, callback._sig.args))})")
        return Target(_checked_address(callback.address), user, keeps)
    if is_a(callback, CFuncPtr):
        return Target(_address_of_ctypes(callback), user, keeps)
    if _is_from(callback, "_cffi_backend"):
        function = _address_of_cffi(callback)
        if function is not None:
            return Target(function, user, keeps)
    if not callable(callback):
        raise TypeError(
            "callback must be a scipy.LowLevelCallable, a numba cfunc, a ctypes or cffi function "
            f"pointer with the signature {EXPECTED}, or a Python callable, "
            f"got {type(callback).__name__}"
        )
    if user_data is not None:
        raise TypeError("user_data is for compiled functions: a Python callable has its own")
    return None


def _is_from(value: Any, package: str) -> bool:
    return type(value).__module__.partition(".")[0] == package


def _checked_address(address: int | None) -> int:
    if not address:
        raise ValueError("callback must not be a NULL pointer")
    return int(address)


def _refuse(given: str) -> TypeError:
    return TypeError(f"callback must have the C signature {EXPECTED}, got {given}")


def _check(signature: str) -> None:
    """Compare ``int (int64_t, ...)``, as a capsule, cffi or numba write it."""
    match = re.fullmatch(r"\s*([^(]*?)\s*(?:\(\s*\*\s*\)\s*)?\((.*)\)\s*", signature)
    if match is None or "(" in match[2]:
        raise _refuse(repr(signature))
    result, *arguments = [_kind_of(one) for one in (match[1], *match[2].split(","))]
    fits = len(arguments) == len(_ARGUMENTS) and result == _RESULT
    for kind, allowed in zip(arguments, _ARGUMENTS):
        fits = fits and (kind in allowed or ("pointer" in allowed and kind.endswith("*")))
    if not fits:
        raise _refuse(signature)


def _kind_of(declared: str) -> str:
    """``const int32_t *`` -> ``i4*``; what is not known stays as it is."""
    stars = declared.count("*")
    words = re.sub(r"\b(const|volatile|restrict)\b|\*", " ", declared).split()
    name = re.sub(r"^(__pyx_t_\w*?_|npy_)(?=u?int(32|64)|float64)", "", " ".join(words))
    return _C_TYPES.get(name, name) + "*" * stars


def _of_low_level(callback: Any, user_data: Any) -> Target:
    """The capsule in it has the function, the signature as its name, the data as its context."""
    if user_data is not None:
        raise TypeError("a LowLevelCallable has its own user_data: do not give user_data as well")
    api = ctypes.pythonapi
    capsule = ctypes.py_object(tuple.__getitem__(callback, 0))
    api.PyCapsule_GetName.restype = ctypes.c_char_p
    api.PyCapsule_GetPointer.restype = api.PyCapsule_GetContext.restype = ctypes.c_void_p
    name = api.PyCapsule_GetName(capsule)
    if name is None:
        raise _refuse("none: give the LowLevelCallable a signature")
    _check(name.decode())
    function = api.PyCapsule_GetPointer(capsule, ctypes.c_char_p(name))
    return Target(_checked_address(function), api.PyCapsule_GetContext(capsule) or 0)


def _ctypes_name(declared: Any) -> str:
    """As C writes it; sizes count, for c_int64 is another type on each platform."""
    if declared is None:
        return "void"
    if not issubclass(type(declared), type):  # a converter, not a type
        return kind_of(declared)
    if getattr(declared, _NATIVE, declared) is not declared:
        return f"{declared.__name__} of the other byte order"
    if declared in (ctypes.c_void_p, ctypes.c_char_p):
        return "void*"
    if issubclass(declared, ctypes._Pointer):
        return _ctypes_name(declared._type_) + "*"
    code = getattr(declared, "_type_", "")
    if isinstance(code, str) and code in ("i", "l", "q"):
        return f"int{8 * ctypes.sizeof(declared)}"
    return "double" if code == "d" else str(declared.__name__)


def _address_of_ctypes(callback: Any) -> int:
    if callback._flags_ & _PYTHON_CALLS:
        raise TypeError("callback must not need the GIL: use CFUNCTYPE, not PYFUNCTYPE")
    if callback.argtypes is None:
        raise _refuse("none: set argtypes and restype of the ctypes function")
    result, *arguments = map(_ctypes_name, (callback.restype, *callback.argtypes))
    _check(f"{result} ({', '.join(arguments)})")
    return _checked_address(ctypes.cast(callback, ctypes.c_void_p).value)


def _cffi() -> Any:
    return importlib.import_module("_cffi_backend").FFI()


def _address_of_cffi(callback: Any) -> int | None:
    """None for a function of a compiled module, which is an ordinary callable."""
    ffi = _cffi()
    try:
        declared = ffi.typeof(callback)
    except TypeError:
        return None
    _check(declared.cname if declared.kind == "function" else f"a {declared.cname}")
    return _checked_address(int(ffi.cast("uintptr_t", callback)))


def _address_of_data(user_data: Any) -> tuple[int, object]:
    """The address, and what must stay alive for it to be valid."""
    if user_data is None:
        return 0, None
    if is_a(user_data, (int, np.integer)) and not is_a(user_data, bool):
        address = whole_number(user_data, "user_data")
        if address is None:
            raise TypeError(f"user_data must be an address, got {kind_of(user_data)}")
        if not 0 <= address <= _MOST_ADDRESS:
            raise ValueError(f"user_data must be an address, got {shown(address)}")
        return address, None
    if is_a(user_data, (ctypes.c_void_p, ctypes._Pointer, ctypes.c_char_p)):
        return ctypes.cast(user_data, ctypes.c_void_p).value or 0, user_data
    if _is_from(user_data, "_cffi_backend"):
        return int(_cffi().cast("uintptr_t", user_data)), user_data
    return _address_of_buffer(user_data)


def _address_of_buffer(user_data: Any) -> tuple[int, object]:
    try:
        view = memoryview(user_data)
    except MemoryError:
        raise
    except Exception as error:  # arrays of some types refuse, and objects may raise anything
        raise TypeError(
            "user_data must be a ctypes or cffi pointer, an address or a buffer, "
            f"got {kind_of(user_data)}: {told(error)}"
        ) from error
    if not view.c_contiguous:
        raise ValueError("user_data must be contiguous in memory")
    return int(np.asarray(view).ctypes.data), view
