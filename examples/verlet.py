# SPDX-License-Identifier: BSD-3-Clause
"""Molecular dynamics of a Lennard-Jones fluid with a pair list that is kept over steps.

Prints the energy, which must hardly change, and how often the list was built.
Usage: python examples/verlet.py [number of steps]
"""

import sys

import numpy as np

import halfshell as hs

CUTOFF = 2.5  # in units of the diameter of a particle
TIME_STEP = 0.004
SIDE = 10  # particles along each edge of the box
SPACING = 1.2  # between them at first


def forces_of(pair_list, n):
    """Forces on all particles and the potential energy, shifted to be zero at the cutoff."""
    i, j, d, D = pair_list.pairs(quantities="ijdD")
    sixth = d**-6
    energy = float(np.sum(4.0 * sixth * (sixth - 1.0))) - len(d) * 4.0 * CUTOFF**-6 * (
        CUTOFF**-6 - 1.0
    )
    pushes = (24.0 * sixth * (2.0 * sixth - 1.0) / d**2)[:, None] * D
    forces = np.empty((n, 3))
    for k in range(3):
        forces[:, k] = np.bincount(j, pushes[:, k], n) - np.bincount(i, pushes[:, k], n)
    return forces, energy


def main(n_steps=200):
    """Run it; return the largest change of the energy per particle."""
    rng = np.random.default_rng(1)
    grid = np.arange(SIDE) * SPACING
    points = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    box = np.full(3, SIDE * SPACING)
    velocities = rng.normal(0.0, 1.0, points.shape)
    velocities -= velocities.mean(axis=0)
    pair_list = hs.VerletList(CUTOFF, box=box)
    pair_list.update(points)
    forces, potential = forces_of(pair_list, len(points))
    start = potential + 0.5 * float(np.sum(velocities**2))
    worst = 0.0
    for step in range(1, n_steps + 1):
        velocities += 0.5 * TIME_STEP * forces
        points = (points + TIME_STEP * velocities) % box
        pair_list.update(points)
        forces, potential = forces_of(pair_list, len(points))
        velocities += 0.5 * TIME_STEP * forces
        energy = potential + 0.5 * float(np.sum(velocities**2))
        worst = max(worst, abs(energy - start) / len(points))
        if step % 50 == 0:
            print(
                f"step {step}: energy {energy / len(points):.4f} a particle, "
                f"{pair_list.n_builds} builds, skin {pair_list.skin:.3f}"
            )
    return worst


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
