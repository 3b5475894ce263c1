"""What no walk does: one that exploded is an error, never an outcome.

What is watched is the root's energy, as a height: its own above the ground and v^2 / 2g.  So height and speed are
bounded at once, and nothing but V_p may add to them.  Nor does a walk tilt past a right angle, before the trunk touches
the ground, with more energy than it takes to tumble.  A push of impulse J adds at most J / m to the speed of the centre
of mass, while the root may move faster as the insect is turned over: of those pushed the centre of mass is watched.
`docs/exploded_walks.md` has the figures.
"""

from typing import Any, NamedTuple

import numpy as np

from hexmj.errors import StillThrown
from hexmj.jitted import jitted
from hexmj.physics.settling import Settled

MOST_ENERGY = 2.0
"""Greatest energy of a root without V_p and pushes, as a height in lengths of the shortest leg; measured is 1.2."""

TUMBLING = 1.5
"""Greatest energy of one that tilts past a right angle; measured is 1.2."""


class Explosion(NamedTuple):
    """What the first of some walks that exploded did."""

    row: int
    """Which of them."""
    substep: int
    """In which of theirs."""
    what: str
    """What no walk does."""


def explosion(
    qpos: np.ndarray, centre: np.ndarray, valid: np.ndarray, impulse: np.ndarray, settled: Settled
) -> Explosion | None:
    """What the first walk did that exploded, none if none did.

    Args:
        qpos: before each substep, (n, substep, position).
        centre: of mass, likewise in the world, (n, substep, 3) [mm].
        valid: substeps up to the fall, (n,).
        impulse: of all pushes so far, added up, (n,) [g mm/s].
        settled: what the walks began with.
    """
    most, tumbling = most_energy(settled, impulse), TUMBLING * settled.compiled.body.lengths.shortest_leg
    top, timestep, twice_g = (
        settled.conditions.highest_ground,
        settled.compiled.model.opt.timestep,
        _twice_gravity(settled),
    )
    row, t = _first_odd((qpos, centre), valid, impulse != 0.0, (most, tumbling), (top, timestep, twice_g))
    if row < 0:
        return None
    if not impulse[row] and (upright := _upright(qpos[row, t])) < 0.0:
        return Explosion(row, t, f"it tilts by {np.arccos(upright):.3g} rad, past a right angle, and was not pushed")
    name, place = ("centre of mass", centre[row]) if impulse[row] else ("root", qpos[row, :, :3])
    height, speed = place[t, 2] - top, np.linalg.norm(place[t] - place[t - 1]) / timestep
    what = (
        f"its {name} is {height:.3g} mm above the ground and moves at {speed:.3g} mm/s; expected height and"
        f" v^2 / 2g of at most {most[row]:.3g} mm together"
    )
    return Explosion(row, t, what)


@jitted
def _first_odd(shown: Any, valid: Any, pushed: Any, limits: Any, scale: Any) -> tuple[int, int]:
    """Row and substep in which something moves as no walk does; -1 if nothing does."""
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


def check_landed(ids: np.ndarray, qpos: np.ndarray, qvel: np.ndarray, impulse: np.ndarray, settled: Settled) -> None:
    """Refuse walks that end before their push is over: the root has more energy than that of a walk without one.

    Args:
        ids: which starts have not fallen, (n,).
        qpos: at the end, (n, position).
        qvel: likewise, (n, velocity).
        impulse: of all pushes so far, added up, (n,) [g mm/s].
        settled: what the walks began with.

    Raises:
        StillThrown: the first of them.
    """
    speed, height = np.linalg.norm(qvel[:, :3], axis=1), qpos[:, 2] - settled.conditions.highest_ground
    energy, most = height + speed**2 / _twice_gravity(settled), most_energy(settled, np.zeros(1))[0]
    thrown = np.flatnonzero((energy > most) & (impulse != 0.0))
    if len(thrown):
        first = thrown[0]
        raise StillThrown(
            f"start {ids[first]} is still thrown by its push as the window ends: its root is {height[first]:.3g} mm"
            f" above the ground and moves at {speed[first]:.3g} mm/s; expected a longer window or a weaker push"
        )


def most_energy(settled: Settled, impulse: np.ndarray) -> np.ndarray:
    """Greatest energy after a push, (n,) [g mm/s], as a height, (n,) [mm]."""
    body = settled.compiled.body
    fastest = settled.conditions.vp + np.abs(impulse) / body.mass
    return MOST_ENERGY * body.lengths.shortest_leg + fastest**2 / _twice_gravity(settled)


def _twice_gravity(settled: Settled) -> float:
    return 2.0 * settled.compiled.weight / settled.compiled.body.mass
