# SPDX-License-Identifier: BSD-3-Clause
"""The scenes that move do what they say: a list that is kept too long shows as energy."""

import numpy as np
import pytest

import halfshell as hs
from halfshell_report import scenes

MOVING = [name for name in scenes.names() if scenes.load(name, "small").motion is not None]


def pair_forces(scene, x, pairs):
    """Forces and energy of the Lennard-Jones potential over the pairs that are within reach."""
    motion, i, j, S = scene.motion, *pairs
    D = x[j] - x[i] + S * scene.box
    r = np.sqrt((D * D).sum(axis=1))
    near = r < scene.cutoff
    i, j, D, r = i[near], j[near], D[near], r[near]
    value, slope = lennard_jones(motion, r)
    value_there, slope_there = lennard_jones(motion, scene.cutoff)
    energy = (value - value_there - (r - scene.cutoff) * slope_there).sum()
    return scattered(x, i, j, ((slope - slope_there) / r)[:, None] * D), energy


def lennard_jones(motion, r):
    """Value and slope."""
    p = (motion.sigma / r) ** 6
    return 4 * motion.epsilon * (p * p - p), 4 * motion.epsilon * (6 * p - 12 * p * p) / r


def bond_forces(scene, x):
    """Forces and energy of the springs."""
    motion = scene.motion
    i, j = motion.bonds.T
    D = x[j] - x[i]
    r = np.sqrt((D * D).sum(axis=1))
    longer = r - motion.lengths
    forces = scattered(x, i, j, (motion.stiffnesses * longer / r)[:, None] * D)
    return forces, 0.5 * (motion.stiffnesses * longer**2).sum()


def scattered(x, i, j, pulls):
    """Forces on points from what pulls i towards j, and j towards i."""
    forces = np.zeros_like(x)
    np.add.at(forces, i, pulls)
    np.add.at(forces, j, -pulls)
    return forces


def listed(scene, x, reach):
    return hs.pairs(x, reach, box=scene.box, quantities="ijS")


def all_forces(scene, x, pairs):
    """Forces and energy of the whole potential."""
    parts = pair_forces(scene, x, pairs), bond_forces(scene, x)
    return sum(part[0] for part in parts), sum(part[1] for part in parts)


def energy(scene, x, v):
    """Total energy, from a list that was just made."""
    potential = all_forces(scene, x, listed(scene, x, scene.cutoff))[1]
    return potential + 0.5 * scene.motion.mass * (v * v).sum()


def energies(scene, stale):
    """Total energy after each step, less that at the start, by velocity Verlet.

    `stale(moved, step)`: whether the list of all pairs within cutoff + skin is made anew.
    """
    motion = scene.motion
    kick = 0.5 * motion.dt / motion.mass
    x, v, since = scene.points.copy(), motion.velocities.copy(), scene.points
    pairs, lists = listed(scene, x, scene.cutoff + motion.skin), 1
    forces = all_forces(scene, x, pairs)[0]
    found = [energy(scene, x, v)]
    for step in range(1, motion.n_steps + 1):
        v += kick * forces
        x = x + motion.dt * v
        if stale(np.sqrt(((x - since) ** 2).sum(axis=1).max()), step):
            pairs, since, lists = listed(scene, x, scene.cutoff + motion.skin), x, lists + 1
        forces = all_forces(scene, x, pairs)[0]
        v += kick * forces
        found.append(energy(scene, x, v))
    return np.array(found) - found[0], lists


@pytest.fixture(scope="module", params=MOVING)
def scene(request):
    return scenes.load(request.param, "small")


@pytest.fixture(scope="module")
def fresh(scene):
    """Energies with a list that is made anew at each step."""
    return energies(scene, lambda moved, step: True)[0]


def test_energy_is_kept_with_a_list_for_each_step(fresh):
    assert abs(fresh).max() < 2.0
    assert abs(fresh[-1]) < 0.5


def test_half_the_skin_is_enough(scene, fresh):
    found, lists = energies(scene, lambda moved, step: moved > scene.motion.skin / 2)
    assert np.abs(found - fresh).max() < 1e-6
    assert 5 < lists < scene.motion.n_steps / 5


def test_a_list_for_every_twenty_steps_shows_as_energy(scene, fresh):
    found, _ = energies(scene, lambda moved, step: step % 20 == 0)
    assert found[-1] > 10.0 > 10.0 * abs(fresh[-1])
