"""Why an insect falls, or does not fall although its plan loses static stability: one named mechanism for every start.

The time constant T = sqrt(h / g) is that of an inverted pendulum of the standing height h. A planned loss begins when
the plan's margin around the body's own centre of mass is no longer positive. It ends when all of these are true:

- the plan is stable again;
- the centre of mass is above the polygon of the feet that carry load;
- the trunk has stayed below a tilt of `TIPPED` for a time T.

A fall begins when the trunk last had stayed below a tilt of `TIPPED` for a time T. Two things decide its mechanism: how
the trunk leaned from 2 T before this beginning until the fall, and the plan's smallest margin in the time T before the
beginning.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hexmj.rotations import lean
from hexmj.stability import walk_margin
from hexmj.walks import Walk

if TYPE_CHECKING:
    from hexmj.measures.physical import PhysicalWalk

TIPPED = 0.05
"""Tilt above which the trunk has tipped [rad]; a trunk tilts by 0.01 rad in a walk and by 0.16 rad in a fall."""

MECHANISMS = {
    "never_lost": "no planned loss and no fall",
    "still_standing": "saved: the centre of mass never left the polygon of the feet that carry load",
    "too_short": "saved: the centre of mass left the polygon of the feet that carry load, but the trunk never tipped",
    "landed_in_time": "saved: the trunk had tipped, and the feet that the plan put down held it",
    "caught": "saved: the trunk came down on a foot that the plan held in the air",
    "tipped_behind": "fell as the plan lost stability, leaning back",
    "tipped_ahead": "fell as the plan lost stability, leaning ahead",
    "thrown": "fell to another side than it had first tipped to: a foot met the ground, and its leg threw the trunk",
    "unplanned": "fell although the margin of the plan was wide",
    "narrow": "fell although the plan did not lose stability: its margin was narrow",
}
"""Mechanism -> its definition. A start that survives several planned losses gets the last mechanism in this order."""

NARROW = 0.1
"""Maximum margin of the plan that counts as narrow, as a fraction of the standing height. Falls with a positive margin
were observed at 0 to 0.09, since lifting feet push the trunk and yielding legs shift its centre of mass."""

SAVED = ("still_standing", "too_short", "landed_in_time", "caught")
"""Mechanisms of starts with a planned loss but no fall."""

_NUMBER = {name: number for number, name in enumerate(MECHANISMS)}


def mechanisms(walk: "PhysicalWalk") -> np.ndarray:
    """Return the mechanism of each start as an index in `MECHANISMS`, (start,).

    A planned loss that has not ended at the end of the observation time counts as survived.
    """
    fell, known = np.isfinite(walk.outcomes.fall), np.isfinite(walk.qpos[..., 0]).sum(axis=0)
    kept, outside = walk_margin(static_plan(walk)), walk_margin(walk.measured) <= 0.0
    leans, tilt = lean(walk.qpos[..., 3:7])
    steps = _time_constant(walk)
    upright = _long_upright(tilt < TIPPED, steps)
    caught = _caught(walk)
    narrow = NARROW * walk.conditions.standing_height
    names = np.full(len(fell), _NUMBER["never_lost"])
    for start, end in enumerate(known):
        rows = slice(end), start
        if fell[start]:
            end = max(end, 1)  # a start that falls within its first step has no known row
            tips = min(int(np.flatnonzero(np.append(True, upright[rows]))[-1]), end - 1)
            least = kept[max(tips - steps, 0) : tips + 1, start].min()
            since = slice(max(tips - 2 * steps, 0), end), start
            names[start] = _fall(leans[since][tilt[since] >= TIPPED], leans[end - 1, start], least, narrow)
            continue
        for begin, over in _losses(kept[rows] <= 0.0, (upright & ~outside)[rows]):
            exposed = tilt[begin:over, start][outside[begin:over, start]]
            names[start] = max(names[start], _rescue(exposed, caught[begin:over, start]))
    return names


def fall_direction(walk: "PhysicalWalk") -> np.ndarray:
    """Return the direction of each fall, (start,) [rad]: 0 is ahead, pi/2 to the left; NaN without a fall."""
    last = np.maximum(np.isfinite(walk.qpos[..., 0]).sum(axis=0) - 1, 0)
    ahead, left = np.moveaxis(lean(walk.qpos[..., 3:7])[0][last, np.arange(len(last))], -1, 0)
    return np.where(np.isfinite(walk.outcomes.fall), np.arctan2(left, ahead), np.nan)


def static_plan(walk: "PhysicalWalk") -> Walk:
    """Return the planned walk with tips relative to the body's own centre of mass in the home posture, not to O."""
    return replace(walk.planned, x=walk.planned.x - walk.conditions.centre_of_mass)


def _fall(tipping: np.ndarray, last: np.ndarray, least: float, narrow: float) -> int:
    """Return the mechanism of a fall, from the lean (ahead, left) of the tipped trunk, (step, 2), its `last` lean,
    (2,), the `least` margin of the plan before the fall, and the maximum margin that counts as `narrow` [mm]."""
    if (tipping @ last < 0.0).any():
        return _NUMBER["thrown"]
    if least > 0.0:
        return _NUMBER["narrow" if least <= narrow else "unplanned"]
    return _NUMBER["tipped_ahead" if last[0] > 0.0 else "tipped_behind"]


def _rescue(exposed: np.ndarray, caught: np.ndarray) -> int:
    """Return the mechanism of a survived loss; `exposed` is the tilt while the centre of mass is outside, (step,)."""
    if caught.any():
        return _NUMBER["caught"]
    if not exposed.size:
        return _NUMBER["still_standing"]
    return _NUMBER["landed_in_time" if exposed.max() >= TIPPED else "too_short"]


def _losses(lost: np.ndarray, recovered: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield first step and end of each planned loss of a start, from masks (step,): plan unstable, body recovered."""
    begin = 0
    while lost[begin:].any():
        begin += int(np.argmax(lost[begin:]))
        over = recovered[begin:] & ~lost[begin:]
        end = begin + int(np.argmax(over)) if over.any() else len(lost)
        yield begin, end
        begin = end


def _time_constant(walk: "PhysicalWalk") -> int:
    """Return sqrt(h / g), the time constant of an inverted pendulum of the standing height h, in steps of the plan."""
    from hexmj.bodies.mjcf import gravity

    seconds = np.sqrt(walk.conditions.standing_height / gravity(walk.conditions.body))
    return int(np.ceil(seconds / walk.conditions.seconds(walk.stride)))


def _long_upright(upright: np.ndarray, steps: int) -> np.ndarray:
    """Return whether the trunk has been `upright`, (step, start), in each of the last `steps` steps, (step, start)."""
    tipped = np.concatenate([np.zeros((steps, upright.shape[1]), dtype=int), np.cumsum(~upright, axis=0)])
    return tipped[steps:] == tipped[:-steps]


def _caught(walk: "PhysicalWalk") -> np.ndarray:
    """Return whether a foot has lifted off and is back on the ground while the plan swings it, (step, start, leg).

    False while the plan lowers the foot close to its AEP; a plan without AEPs lowers no foot.
    """
    stance, stands = walk.planned.stance, walk.measured.stance
    landing = walk.conditions.landing_distance
    held = ~stance & ~(walk.planned.x >= walk.planned.aep - landing)
    step = np.arange(len(stance), dtype=np.int32)[:, None, None]
    planned_down = np.maximum.accumulate(np.where(stance, step, -1), axis=0)
    off = np.maximum.accumulate(np.where(stands, -1, step), axis=0)
    return held & stands & (off > planned_down)
