# SPDX-License-Identifier: BSD-3-Clause
"""Arrays of other libraries that have no plain numbers to hand over, refused by what they are.

They are told by their attributes: none of these libraries is imported.
"""

from __future__ import annotations

from typing import Any

from halfshell._convert.foreign import attribute, is_a, kind_of

# As DLPack numbers them; 1 and the pinned kinds 3 and 11 are memory that the CPU reads.
_ELSEWHERE = {
    2: "CUDA", 4: "OpenCL", 7: "Vulkan", 8: "Metal", 10: "ROCm", 12: "an external device",
    13: "CUDA, managed", 14: "oneAPI", 15: "WebGPU", 16: "Hexagon", 17: "MAIA",
}  # fmt: skip


def refuse_tensor(values: Any, name: str) -> None:
    """TypeError for what is sparse, on another device, or needs a gradient."""
    kind = kind_of(values)
    if _is_sparse(values, name):
        raise TypeError(f"{name} must be dense, got a sparse {kind}: convert it first")
    if attribute(values, "requires_grad", name) is True:
        raise TypeError(
            f"{name} must not need a gradient, which would be lost, got a {kind} that does: give "
            "its detach(), or use halfshell.torch"
        )
    device = _device_of(values)
    if device is not None:
        raise TypeError(
            f"{name} must be in memory that the CPU reads, got a {kind} on {device}: copy it there"
        )


def _is_sparse(values: Any, name: str) -> bool:
    if attribute(values, "is_sparse", name) is True:  # of torch
        return True
    if str(attribute(values, "layout", name, "")).startswith("torch.sparse"):
        return True
    # of SciPy, CuPy and the like
    return all(attribute(values, part, name) is not None for part in ("nnz", "shape", "tocsr"))


def _device_of(values: Any) -> str | None:
    """The name of a device that the CPU does not read."""
    try:
        device = values.__dlpack_device__()[0]
    except MemoryError:
        raise
    except Exception:  # it has none, or does not tell: then it is converted, or that fails
        return None
    return _ELSEWHERE.get(int(device)) if is_a(device, int) else None
