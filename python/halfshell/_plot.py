# SPDX-License-Identifier: BSD-3-Clause
"""What all pictures share: matplotlib, which is imported when the first one is drawn, and axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from halfshell._extras import needs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["new_axes"]


def new_axes(ndim: int = 2, **size: Any) -> Axes:
    """Axes of a new figure, in three dimensions for points of three."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError(needs("plot", "matplotlib")) from error
    flat = ndim != 3  # in three dimensions the layout would cut off labels
    how = {} if flat else {"projection": "3d"}
    layout = "constrained" if flat else None
    axes: Axes = pyplot.subplots(layout=layout, subplot_kw=how, **size)[1]
    return axes
