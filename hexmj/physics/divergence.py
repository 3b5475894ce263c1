"""Guard against explosions: a simulation that exploded is an error, never an outcome.

The guard limits the energy of the root, expressed as a height: height above the ground plus v^2 / 2g. Only V_p raises
this limit. A lower limit, the energy of tumbling, holds for a root that tilts past a right angle before the trunk
touches the ground. A push of impulse J adds at most J / m to the speed of the centre of mass, but the root may move
faster when the insect turns over. So after a push the guard limits the energy of the centre of mass instead.
"""

from typing import Any

import numpy as np

from hexmj.jitted import jitted
from hexmj.physics.settle import Settled

MOST_ENERGY = 2.0
"""Maximum energy of a root, apart from V_p and pushes, as a height in lengths of the shortest leg; measured: 1.2."""

TUMBLING = 1.5
"""Maximum energy of a root that tilts past a right angle, in lengths of the shortest leg; measured: 1.2."""


def explosion(
    qpos: np.ndarray, centre: np.ndarray, valid: np.ndarray, impulse: np.ndarray, settled: Settled
) -> tuple[int, int, str] | None:
    """Return the first walk that exploded, or None.

    Args:
        qpos: positions before each substep, (n, substep, position).
        centre: centre of mass before each substep in the world, (n, substep, 3) [mm].
        valid: number of substeps up to the fall, (n,).
        impulse: sum of the sizes of all pushes so far, (n,) [g mm/s].
        settled: the settled starts of the walks.

    Returns:
        Row and substep at which the walk exploded, and a description for the error message.
    """
    most, tumbling = most_energy(settled, impulse), TUMBLING * settled.conditions.body.lengths.shortest_leg
    top, timestep = settled.conditions.highest_ground, settled.compiled.model.opt.timestep
    twice_g = twice_gravity(settled)
    row, t = _first_exploded((qpos, centre), valid, impulse != 0.0, (most, tumbling), (top, timestep, twice_g))
    if row < 0:
        return None
    place, upright = (centre[row] if impulse[row] else qpos[row, :, :3]), _upright(qpos[row, t])
    height, speed = place[t, 2] - top, np.linalg.norm(place[t] - place[t - 1]) / timestep
    name = "centre of mass" if impulse[row] else f"root, tilted by {np.arccos(upright):.3g} rad,"
    return (
        row,
        t,
        f"its {name} is {height:.3g} mm above the ground and moves at {speed:.3g} mm/s, more than a walk can",
    )


@jitted
def _first_exploded(recorded: Any, valid: Any, pushed: Any, limits: Any, scale: Any) -> tuple[int, int]:
    """Return row and substep of the first walk whose energy exceeds its limit; -1 and -1 if there is none."""
    (qpos, centre), (most, tumbling), (top, timestep, twice_g) = recorded, limits, scale
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
    """Return the cosine of the tilt of a root at `qpos`, (position,)."""
    return 1.0 - 2.0 * (qpos[4] ** 2 + qpos[5] ** 2)


def most_energy(settled: Settled, impulse: np.ndarray) -> np.ndarray:
    """Return the maximum energy, as a height, (n,) [mm], of walks after pushes of some impulses, (n,) [g mm/s]."""
    body = settled.conditions.body
    fastest = settled.conditions.vp + np.abs(impulse) / body.mass
    return MOST_ENERGY * body.lengths.shortest_leg + fastest**2 / twice_gravity(settled)


def twice_gravity(settled: Settled) -> float:
    """Return twice the acceleration of gravity [mm/s^2]."""
    return 2.0 * settled.compiled.weight / settled.conditions.body.mass
