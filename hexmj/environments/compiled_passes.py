"""Compiled passes over all insects: what actions ask for, what is observed, and what a step was worth.

For one insect a dozen of NumPy's calls take as long as its physics.  `tests/plain_observations.py` has the same
formulas as one would write them, and a test holds the two against each other.
"""

from typing import Any

import numpy as np

from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.jitted import jitted, part
from hexmj.stability import margins

ROUNDING = 1e-6
"""Excess of an action over its bounds that is let pass: that of a bound rounded to single precision."""


@jitted
def scaled(actions: Any, ids: Any, usual: Any, span: Any) -> Any:
    """What some insects' actions, (insect, number) from -1 to 1, ask for, (n, number) [rad] or [mm].

    `usual` is what 0 asks for, `span` how far it is from there to the least and to the greatest, (2, number).  Returns
    also whether all actions are within their bounds.
    """
    wanted, within = np.empty((len(ids), actions.shape[1])), True
    for i, n in enumerate(ids):
        for j in range(actions.shape[1]):
            within &= abs(actions[n, j]) <= 1.0 + ROUNDING
            wanted[i, j] = usual[j] + actions[n, j] * span[1 if actions[n, j] > 0 else 0, j]
    return wanted, within


@jitted
def beyond(action: Any, low: Any, high: Any) -> int:
    """Which number of an action, (number,), is the first out of its bounds, or none; -1 if all are within."""
    for j in range(len(action)):
        if not low[j] - ROUNDING <= action[j] <= high[j] + ROUNDING:
            return j
    return -1


@jitted
def order(wanted: Any, ids: Any, ahead: Any, planned: Any, offset: bool) -> Any:
    """Where the tips of some insects shall be in their next step, (n, substep, leg, axis) [mm].

    Args:
        wanted: what their actions ask for, (n, number).
        ids: which insects, (n,).
        ahead: tips (insect, step, substep, leg, axis) and stance (insect, step, leg) as planned, and the next step of
            these, (insect,), which goes on.
        planned: of all insects, `observing.Planned`; stance and tips take up what is planned.
        offset: whether actions are offsets to the tips.
    """
    tips_ahead, stance_ahead, at = ahead
    tips = np.empty((len(ids), tips_ahead.shape[2], 6, 3))
    for i, n in enumerate(ids):
        step = at[n]
        for leg in range(6):
            planned[0][n, leg] = stance_ahead[n, step, leg]
            for axis in range(3):
                beside = wanted[i, 3 * leg + axis] if offset else 0.0
                for sub in range(tips.shape[1]):
                    tips[i, sub, leg, axis] = tips_ahead[n, step, sub, leg, axis] + beside
                planned[1][n, leg, axis] = tips_ahead[n, step, tips.shape[1] - 1, leg, axis]
        at[n] = step + 1
    return tips


@jitted
def keep(joints: Any, reachable: Any, ids: Any, last: Any, missed: Any) -> None:
    """Legs that cannot reach their tips keep their last angles.

    Args:
        joints: that put the tips where they shall be, (n, substep, leg, joint) [rad]; the last angles where none do.
        reachable: whether they do, (n, substep, leg).
        ids: which insects, (n,).
        last: angles of all insects, (insect, leg, joint), which go on.
        missed: substeps in which a leg cannot reach its tip, (insect, leg), made anew.
    """
    for i, n in enumerate(ids):
        for leg in range(6):
            missed[n, leg] = 0.0
            for sub in range(joints.shape[1]):
                missed[n, leg] += not reachable[i, sub, leg]
                for j in range(joints.shape[3]):
                    if reachable[i, sub, leg]:
                        last[n, leg, j] = joints[i, sub, leg, j]
                    else:
                        joints[i, sub, leg, j] = last[n, leg, j]


@jitted
def observe(places: Any, corners: Any, standing: Any, planned: Any, bounds: Any, layout: Any, flat: Any) -> None:
    """Write everything that is observed into `flat`, (n, number), cut off at its bounds.

    Args:
        places: of all insects, `observing.Places`.
        corners: of the trunk, (corner, axis), and their radii, (corner,) [mm].
        standing: which feet do, (n, leg).
        planned: stance (n, leg), tips (n, leg, axis), and out of reach (n, leg).
        bounds: least and greatest of every number, (2, number).
        layout: joints, where feet and centre of mass begin among the sensors, the command, and the margin that stands
            for no foot.
    """
    qpos, qvel, rotation, sensors = places
    stance, tips, missed = planned
    joints, foot, centre, command, no_foot = layout
    feet, margin = np.empty((1, 6, 2)), np.empty(1)
    for n in range(len(flat)):
        seen, turn, q, s = flat[n], rotation[n], qpos[n], sensors[n]
        at = _observe_root(q, qvel[n], turn, joints, seen)
        seen[at] = _clearance(q, turn, corners)
        at += 1
        for leg in range(6):
            here = s[foot + 3 * leg : foot + 3 * leg + 3]
            for k in range(3):
                seen[at + k] = 0.0
                for axis in range(3):
                    seen[at + k] += (here[axis] - q[axis]) * turn[axis, k]
            at += 3
            feet[0, leg, 0], feet[0, leg, 1] = here[0] - s[centre], here[1] - s[centre + 1]
        for leg in range(6):
            seen[at + leg] = standing[n, leg]
        margins(feet, standing[n : n + 1], margin)
        seen[at + 6] = max(margin[0], no_foot)
        seen[at + 7] = command
        at += 8
        for leg in range(6):
            seen[at + leg] = stance[n, leg]
            for k in range(3):
                seen[at + 6 + 3 * leg + k] = tips[n, leg, k]
        at += 24
        for i in range(at, len(seen)):
            seen[i] = missed[n, i - at]
        for i in range(len(seen)):
            seen[i] = min(max(seen[i], bounds[0, i]), bounds[1, i])


@part
def _observe_root(q: Any, v: Any, turn: Any, joints: int, seen: Any) -> int:
    """Write joints, orientation and velocities into the first numbers of `seen`; how many these are."""
    for j in range(joints):
        seen[j] = q[ROOT_QPOS + j]
        seen[joints + j] = v[ROOT_QVEL + j]
    at = 2 * joints
    for k in range(4):
        seen[at + k] = q[3 + k]
    at += 4
    angle = np.arctan2(turn[1, 0], turn[0, 0])
    cosine, sine = np.cos(angle), np.sin(angle)
    seen[at] = cosine * v[0] + sine * v[1]
    seen[at + 1] = cosine * v[1] - sine * v[0]
    seen[at + 2] = v[2]
    for k in range(3):
        seen[at + 3 + k] = v[3 + k]
    return at + 6


@part
def _clearance(q: Any, turn: Any, corners: Any) -> float:
    """Height of the trunk's lowest corner [mm]."""
    lowest = np.inf
    for c in range(len(corners[0])):
        corner = corners[0][c]
        up = turn[2, 0] * corner[0] + turn[2, 1] * corner[1] + turn[2, 2] * corner[2]
        lowest = min(lowest, q[2] + up - corners[1][c])
    return lowest


@jitted
def judge(places: Any, ids: Any, sensors: Any, trunk: Any, command: float, time: Any, said: Any) -> bool:
    """Say of those that have walked a step what it was worth, and whether they fell or their time is over.

    Args:
        places: of all insects as they are now, `observing.Places`.
        ids: which have walked, (n,).
        sensors: as each substep began, (n, substep, column).
        trunk: first column of contacts of the trunk's parts, and the one after the last.
        command: velocity to walk at [mm/s].
        time: steps of all insects that are done, (insect,), which go on, and those of an episode.
        said: reward, 0, whether it fell, False, and whether its time is over, False, each (insect,).

    Returns:
        Whether any episode is over.
    """
    (_, qvel, rotation, now), (done, steps), (reward, fell, over), any_over = places, time, said, False
    for i, n in enumerate(ids):
        done[n] += 1
        for one in range(trunk[0], trunk[1]):
            fell[n] |= now[n, one] > 0
            for t in range(sensors.shape[1]):
                fell[n] |= sensors[i, t, one] > 0
        over[n] = done[n] == steps and not fell[n]
        if not fell[n]:
            reward[n] = worth(qvel[n], rotation[n], command)
        any_over |= fell[n] or over[n]
    return any_over


@jitted
def worth(qvel: Any, rotation: Any, command: float) -> float:
    """Reward of a step without a fall, max(0, 1 - |v - c| / c) max(0, u), of one insect as it is now."""
    return max(1.0 - abs(qvel[0] - command) / command, 0.0) * max(rotation[2, 2], 0.0)
