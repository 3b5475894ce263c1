"""Why an insect falls, or does not although its plan loses static stability: one named mechanism for every start.

A planned loss begins when the plan's margin, seen from the body's own centre of mass, is no longer positive.  It is
over when the plan is stable again, the centre of mass is above the polygon of the feet that really stand, and the
trunk has been upright, tilted by less than `TIPPED`, for the time constant of an inverted pendulum of the standing
height, sqrt(h / g); if the trunk touches the ground before that, the loss has led to a fall.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hexmj.bodies.loading import gravity
from hexmj.measures.physical import PhysicalWalk
from hexmj.rotations import lean
from hexmj.stability import walk_margin
from hexmj.walks import Walk

TIPPED = 0.05
"""Tilt of the trunk beyond which it has tipped [rad]; a walking trunk tilts by 0.01, one that falls by 0.16."""

MECHANISMS = {
    "never_lost": "no planned loss and no fall",
    "still_standing": "saved: the centre of mass never left the polygon of the feet that really stood",
    "too_short": "saved: it left that polygon, and came back before the trunk had tipped",
    "landed_in_time": "saved: the trunk had tipped, and the feet that the plan put down held it",
    "caught": "saved: the trunk came down on a foot that the plan held in the air",
    "tipped_behind": "fell after a planned loss, leaning back",
    "tipped_ahead": "fell after a planned loss, leaning ahead",
    "thrown": "fell after it had been caught: when the catching leg was put down, the trunk tipped to the other side",
    "unplanned": "fell without a planned loss",
}
"""Name of each mechanism and its definition; where several losses were survived, the last of the names that apply."""

SAVED = ("still_standing", "too_short", "landed_in_time", "caught")
"""Mechanisms of the starts that were lost on paper and did not fall."""

_NUMBER = {name: number for number, name in enumerate(MECHANISMS)}


def mechanisms(walk: PhysicalWalk, tipped: float = TIPPED) -> np.ndarray:
    """Index in `MECHANISMS` of what happened to each start, (start,).

    Args:
        walk: physical walks kept whole; a loss that the window cuts short counts as survived.
        tipped: as `TIPPED` [rad].
    """
    fell, known = np.isfinite(walk.outcomes.fall), np.isfinite(walk.qpos[..., 0]).sum(axis=0)
    lost = walk_margin(static_plan(walk)) <= 0.0
    outside = walk_margin(walk.measured) <= 0.0
    leans, tilt = lean(walk.qpos[..., 3:7])
    recovered = _long_upright(walk, tilt < tipped) & ~outside
    caught = _caught(walk)
    names = np.where(fell, _NUMBER["unplanned"], _NUMBER["never_lost"])
    for start in np.flatnonzero(lost.any(axis=0)):
        end = known[start]
        for begin, over in _losses(lost[:end, start], recovered[:end, start]):
            steps = slice(begin, over), start
            if fell[start] and over == end:
                names[start] = _fall(leans[steps], caught[steps], walk.planned.stance[steps])
            elif not fell[start]:
                exposed = tilt[steps][outside[steps]]
                names[start] = max(names[start], _rescue(exposed, caught[steps], tipped))
    return names


def fall_direction(walk: PhysicalWalk) -> np.ndarray:
    """Where the trunk leans when it falls, from straight ahead to the left, (start,) [rad]; NaN without a fall."""
    last = np.maximum(np.isfinite(walk.qpos[..., 0]).sum(axis=0) - 1, 0)
    ahead, left = np.moveaxis(lean(walk.qpos[..., 3:7])[0][last, np.arange(len(last))], -1, 0)
    return np.where(np.isfinite(walk.outcomes.fall), np.arctan2(left, ahead), np.nan)


def static_plan(walk: PhysicalWalk) -> Walk:
    """The planned walk seen from the body's own centre of mass at home, which `Masses.centre_of_mass` moves from O."""
    return replace(walk.planned, x=walk.planned.x - walk.conditions.masses.centre_of_mass)


def _fall(lean: np.ndarray, caught: np.ndarray, stance: np.ndarray) -> int:
    """The mechanism of a loss that led to a fall, from what its steps have shown: (step, 2), (step, leg) twice."""
    put_down = (np.maximum.accumulate(caught) & stance).any(axis=1)
    if put_down.any() and lean[np.argmax(put_down) - 1] @ lean[-1] < 0.0:
        return _NUMBER["thrown"]
    return _NUMBER["tipped_ahead" if lean[-1, 0] > 0.0 else "tipped_behind"]


def _rescue(exposed: np.ndarray, caught: np.ndarray, tipped: float) -> int:
    """The mechanism of a loss that was survived, from the tilt while the centre of mass was outside, (step,)."""
    if caught.any():
        return _NUMBER["caught"]
    if not exposed.size:
        return _NUMBER["still_standing"]
    return _NUMBER["landed_in_time" if exposed.max() >= tipped else "too_short"]


def _losses(lost: np.ndarray, recovered: np.ndarray) -> Iterator[tuple[int, int]]:
    """Where each planned loss begins and is over, from one start's steps, both (step,)."""
    begin = 0
    while lost[begin:].any():
        begin += int(np.argmax(lost[begin:]))
        over = recovered[begin:] & ~lost[begin:]
        end = begin + int(np.argmax(over)) if over.any() else len(lost)
        yield begin, end
        begin = end


def _long_upright(walk: PhysicalWalk, upright: np.ndarray) -> np.ndarray:
    """Where the trunk has been upright for sqrt(h / g), (step, start)."""
    time_constant = np.sqrt(walk.conditions.path.standing_height / gravity(walk.conditions.body))
    steps = int(np.ceil(time_constant / walk.conditions.time.seconds(walk.stride)))
    tipped = np.concatenate([np.zeros((steps, upright.shape[1]), dtype=int), np.cumsum(~upright, axis=0)])
    return tipped[steps:] == tipped[:-steps]


def _caught(walk: PhysicalWalk) -> np.ndarray:
    """Where a foot that the plan holds in the air stands again after it had left the ground, (step, start, leg).

    One that is lowered to its AEP lands.
    """
    stance, stands = walk.planned.stance, walk.measured.stance
    landing = walk.conditions.path.landing_distance(walk.conditions.time)
    held = ~stance & (walk.planned.x < walk.planned.aep - landing)
    step = np.arange(len(stance), dtype=np.int32)[:, None, None]
    planned_down = np.maximum.accumulate(np.where(stance, step, -1), axis=0)
    off = np.maximum.accumulate(np.where(stands, -1, step), axis=0)
    return held & stands & (off > planned_down)
