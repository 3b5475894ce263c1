"""Guards: a simulation that diverged or exploded is an error, never an outcome.

The guard against explosions bounds the energy of the root as a height: its own above the ground and v^2 / 2g, to which
only V_p may add. Nor does a walk tilt past a right angle, before the trunk touches the ground, with more energy than it
takes to tumble. A push of impulse J adds at most J / m to the speed of the centre of mass, while the root may move
faster when the insect turns over: after a push the energy of the centre of mass is bounded.
"""

from typing import Any

import numpy as np

from hexmj.jitted import jitted
from hexmj.physics.settle import Settled

MOST_ENERGY = 2.0
"""Greatest energy of a root without V_p and pushes, as a height in lengths of the shortest leg; measured is 1.2."""

TUMBLING = 1.5
"""Greatest energy of a root that tilts past a right angle; measured is 1.2."""


def explosion(
    qpos: np.ndarray, centre: np.ndarray, valid: np.ndarray, impulse: np.ndarray, settled: Settled
) -> tuple[int, int, str] | None:
    """Find the first walk that exploded, None if none did.

    Args:
        qpos: before each substep, (n, substep, position).
        centre: centre of mass before each substep in the world, (n, substep, 3) [mm].
        valid: substeps up to the fall, (n,).
        impulse: sum of all pushes so far, (n,) [g mm/s].
        settled: the starts of the walks.

    Returns:
        Its row, its substep, and what happened.
    """
    most, tumbling = most_energy(settled, impulse), TUMBLING * settled.conditions.body.lengths.shortest_leg
    top, timestep = settled.conditions.highest_ground, settled.compiled.model.opt.timestep
    twice_g = twice_gravity(settled)
    row, t = _first_odd((qpos, centre), valid, impulse != 0.0, (most, tumbling), (top, timestep, twice_g))
    if row < 0:
        return None
    place, upright = (centre[row] if impulse[row] else qpos[row, :, :3]), _upright(qpos[row, t])
    height, speed = place[t, 2] - top, np.linalg.norm(place[t] - place[t - 1]) / timestep
    name = "centre of mass" if impulse[row] else f"root, tilted by {np.arccos(upright):.3g} rad,"
    return (
        row,
        t,
        f"its {name} is {height:.3g} mm above the ground and moves at {speed:.3g} mm/s, as no walk does",
    )


@jitted
def _first_odd(shown: Any, valid: Any, pushed: Any, limits: Any, scale: Any) -> tuple[int, int]:
    """Row and substep of the first walk beyond the limits; -1 if there is none."""
    (qpos, centre), (most, tumbling), (top, timestep, twice_g) = shown, limits, scale
    for n in range(len(qpos)):
        place = centre[n] if pushed[n] else qpos[n]
        for t in range(1, valid[n]):
            squared = 0.0
            for axis in range(3):
                squared += (place[t, axis] - place[t - 1, axis]) ** 2
            energy = place[t, 2] - top + squared / timestep**2 / twice_g
            if energy > most[n] or (energy > tumbling and not pushed[n] and _upright(qpos[n, t]) < 0.0):
                return n, t
    return -1, -1


@jitted
def _upright(qpos: Any) -> float:
    """Cosine of the tilt of a root, from its positions."""
    return 1.0 - 2.0 * (qpos[4] ** 2 + qpos[5] ** 2)


def most_energy(settled: Settled, impulse: np.ndarray) -> np.ndarray:
    """Greatest energy after a push, (n,) [g mm/s], as a height, (n,) [mm]."""
    body = settled.conditions.body
    fastest = settled.conditions.vp + np.abs(impulse) / body.mass
    return MOST_ENERGY * body.lengths.shortest_leg + fastest**2 / twice_gravity(settled)


def twice_gravity(settled: Settled) -> float:
    """Twice the acceleration of gravity [mm/s^2]."""
    return 2.0 * settled.compiled.weight / settled.conditions.body.mass
