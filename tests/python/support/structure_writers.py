# SPDX-License-Identifier: BSD-3-Clause
"""Files as MDAnalysis writes them: of water, in boxes with right angles."""

import warnings

import numpy as np
import pytest


def write_by_mdanalysis(frames, first, *others):
    """Write (points, lengths) of the first frame to one file, and of all to others."""
    MDAnalysis = pytest.importorskip("MDAnalysis", reason="MDAnalysis is not installed")
    n = len(frames[0][0])
    universe = MDAnalysis.Universe.empty(n, n_residues=n, atom_resindex=range(n), trajectory=True)
    named = {"names": np.resize(["O", "H"], n), "resnames": ["WAT"] * n, "resids": range(1, n + 1)}
    for name, values in (*named.items(), ("charges", [0.0] * n), ("radii", [1.0] * n)):
        universe.add_TopologyAttr(name, values)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in (first, *others):
            with MDAnalysis.Writer(str(path), n) as writer:
                for points, lengths in frames if path in others else frames[:1]:
                    universe.atoms.positions, universe.dimensions = points, [*lengths, 90, 90, 90]
                    writer.write(universe.atoms)
    return first
