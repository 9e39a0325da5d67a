# SPDX-License-Identifier: BSD-3-Clause
"""Run a script in a fresh interpreter, so that a crash or a leak is a test result."""

import json
import subprocess
import sys

# Resident memory of this process in bytes, on every platform, without further packages.
RESIDENT = """
import sys
def resident():
    if sys.platform == "linux":
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * __import__("os").sysconf("SC_PAGE_SIZE")
    if sys.platform == "win32":
        import ctypes
        from ctypes import wintypes
        class Counters(ctypes.Structure):
            _fields_ = [("cb", wintypes.DWORD), ("faults", wintypes.DWORD)] + [
                (name, ctypes.c_size_t) for name in
                ("peak", "resident", "a", "b", "c", "d", "pagefile", "peak_pagefile")]
        counters = Counters()
        ctypes.windll.psapi.GetProcessMemoryInfo(
            wintypes.HANDLE(-1), ctypes.byref(counters), ctypes.sizeof(counters))
        return counters.resident
    import resource  # macOS: the peak, in bytes; it does not grow either
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
"""


# Whoever starts the tests in the background may have SIGINT ignored, which is inherited.
HEARS_INTERRUPTS = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"


def run(script, timeout=600):
    """Run a script that prints one line of JSON at its end; return what it printed.

    The limit is for what hangs: tests of memory take minutes on a busy machine.
    """
    command = [sys.executable, "-c", HEARS_INTERRUPTS + script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, f"exit status {done.returncode}\n{done.stderr[-3000:]}"
    return json.loads(done.stdout.splitlines()[-1])
