"""What no walk does: one that exploded is an error, never an outcome.

What is watched is the root's energy, as a height: its own above the ground and v^2 / 2g.  So height and speed are
bounded at once, and nothing but V_p may add to them.  Nor does a walk tilt past a right angle, before the trunk touches
the ground, with more energy than it takes to tumble.  A push of impulse J adds at most J / m to the speed of the centre
of mass, while the root may move faster as the insect is turned over: of those pushed the centre of mass is watched.
`docs/exploded_walks.md` has the figures.
"""

from typing import NamedTuple

import numpy as np

from hexmj.errors import StillThrown
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
        impulse: of a push, (n,) [g mm/s].
        settled: what the walks began with.
    """
    compiled, pushed = settled.compiled, impulse[:, np.newaxis] != 0.0
    place = np.where(pushed[..., np.newaxis], centre, qpos[..., :3])
    speed = np.linalg.norm(np.diff(place, axis=1), axis=2) / compiled.model.opt.timestep
    height, upright = place[:, 1:, 2] - settled.conditions.ground.top, 1.0 - 2.0 * (qpos[:, 1:, 4:6] ** 2).sum(axis=2)
    energy, most = height + speed**2 / _twice_gravity(settled), most_energy(settled, impulse)[:, np.newaxis]
    within = np.arange(1, qpos.shape[1]) < valid[:, np.newaxis]
    over = (upright < 0.0) & (energy > TUMBLING * compiled.body.lengths.shortest_leg) & ~pushed & within
    odd = over | ((energy > most) & within)
    if not odd.any():
        return None
    row, t = np.argwhere(odd)[0]
    if over[row, t]:
        what = f"it tilts by {np.arccos(upright[row, t]):.3g} rad, past a right angle, and was not pushed"
    else:
        watched = "centre of mass" if pushed[row, 0] else "root"
        what = (
            f"its {watched} is {height[row, t]:.3g} mm above the ground and moves at {speed[row, t]:.3g} mm/s; expected"
            f" height and v^2 / 2g of at most {most[row, 0]:.3g} mm together"
        )
    return Explosion(int(row), int(t) + 1, what)


def check_landed(ids: np.ndarray, qpos: np.ndarray, qvel: np.ndarray, impulse: np.ndarray, settled: Settled) -> None:
    """Refuse walks that end before their push is over: the root has more energy than that of a walk without one.

    Args:
        ids: which starts have not fallen, (n,).
        qpos: at the end, (n, position).
        qvel: likewise, (n, velocity).
        impulse: of a push, (n,) [g mm/s].
        settled: what the walks began with.

    Raises:
        StillThrown: the first of them.
    """
    speed, height = np.linalg.norm(qvel[:, :3], axis=1), qpos[:, 2] - settled.conditions.ground.top
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
    fastest = settled.conditions.time.vp + np.abs(impulse) / body.mass
    return MOST_ENERGY * body.lengths.shortest_leg + fastest**2 / _twice_gravity(settled)


def _twice_gravity(settled: Settled) -> float:
    return 2.0 * settled.compiled.weight / settled.compiled.body.mass
