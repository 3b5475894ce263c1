"""What no walk does: one that exploded is an error, never an outcome.

What is watched is the root's energy, as a height: its own above the ground and v^2 / 2g.  So height and speed are
bounded at once, and nothing but V_p and a push may add to them.  Nor does a walk that is not pushed tilt past a right
angle, before the trunk touches the ground, with more energy than it takes to tumble.  `docs/exploded_walks.md` has the
figures.
"""

from typing import NamedTuple

import numpy as np

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


def explosion(qpos: np.ndarray, valid: np.ndarray, impulse: np.ndarray, settled: Settled) -> Explosion | None:
    """What the first walk did that exploded, none if none did.

    Args:
        qpos: before each substep, (n, substep, position).
        valid: substeps up to the fall, (n,).
        impulse: of a push, (n,) [g mm/s].
        settled: what the walks began with.
    """
    conditions, compiled = settled.conditions, settled.compiled
    length, twice_gravity = compiled.body.lengths.shortest_leg, 2.0 * compiled.weight / compiled.body.mass
    fastest = conditions.time.vp + np.abs(impulse[:, np.newaxis]) / compiled.body.mass
    speed = np.linalg.norm(np.diff(qpos[..., :3], axis=1), axis=2) / compiled.model.opt.timestep
    height, upright = qpos[:, 1:, 2] - conditions.ground.top, 1.0 - 2.0 * (qpos[:, 1:, 4:6] ** 2).sum(axis=2)
    most = MOST_ENERGY * length + fastest**2 / twice_gravity
    energy, within = height + speed**2 / twice_gravity, np.arange(1, qpos.shape[1]) < valid[:, np.newaxis]
    over = (upright < 0.0) & (energy > TUMBLING * length) & (impulse[:, np.newaxis] == 0.0) & within
    odd = over | ((energy > most) & within)
    if not odd.any():
        return None
    row, t = np.argwhere(odd)[0]
    if over[row, t]:
        what = f"it tilts by {np.arccos(upright[row, t]):.3g} rad, past a right angle, and was not pushed"
    else:
        what = (
            f"its root is {height[row, t]:.3g} mm above the ground and moves at {speed[row, t]:.3g} mm/s; expected"
            f" height and v^2 / 2g of at most {most[row, 0]:.3g} mm together"
        )
    return Explosion(int(row), int(t) + 1, what)
