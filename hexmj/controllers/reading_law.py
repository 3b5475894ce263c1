"""The law of plans that read the legs: a start feels what is told of it, and nothing else."""

from dataclasses import fields
from typing import Any

import numpy as np

from hexmj.controllers.checked_plans import advanced, tell
from hexmj.controllers.protocol import FeedbackPlan, Sensed
from hexmj.controllers.trial import Trial, every_other, mixed, same
from hexmj.errors import InputError
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk, joined, of_starts

TOLD = 99
"""How often a plan is told something."""

NUMBERS = 50
"""What each start feels besides its feet: six chances, 18 joints and their torques, tilt, velocity and turning."""


def told(trial: Trial) -> None:
    """A start that a plan is told of walks as it does alone, and those it is not told of as if nobody were.

    After half of the steps every other one of those it is told of has fallen.

    Raises:
        InputError: they do not, or the plan changes what it is told.
    """
    if isinstance(plan := trial.begin(), FeedbackPlan):
        which, last = every_other(trial), len(trial.starts) - 2
        felt = np.random.default_rng(0).uniform(-1.0, 1.0, (TOLD, len(which), NUMBERS))
        felt[:, ~which] = felt[TOLD // 2 :, ::4] = np.nan
        walk = _as_told(trial, felt)
        by_itself = of_starts(advanced(plan, len(walk.time)), ~which)
        same(walk, mixed(walk, ~which, by_itself), "starts it is told nothing of")
        alone = _as_told(trial.of([last]), felt[:, [last]])
        same(walk, mixed(walk, np.arange(len(which)) == last, alone), "a start it is told of, beside others and alone,")


def _as_told(trial: Trial, felt: np.ndarray) -> PlannedWalk:
    """Steps of a plan that is told how starts feel, (step, start, number), but for those that are NaN."""
    plan: Any = trial.begin()
    parts = [advanced(plan, 1)]
    for numbers in felt:
        ids = np.flatnonzero(np.isfinite(numbers[:, 0]))
        sensed, before = (_sensed(parts[-1], ids, trial.stride, numbers[ids]) for _ in range(2))
        tell(plan, sensed)
        for one in fields(Sensed):
            if not np.array_equal(getattr(sensed, one.name), getattr(before, one.name)):
                raise InputError(f"sense changes what it is told, {one.name}; expected it to work on a copy")
        parts.append(advanced(plan, 1))
    return joined(parts)


def _sensed(walk: PlannedWalk, ids: np.ndarray, stride: Stride, numbers: np.ndarray) -> Sensed:
    """What legs would know that do as the last step says, their feet 10 mm below the root where they stand.

    All else is made of numbers between -1 and 1, (n, number): contacts that come and go, joints, and the root's motion.
    """
    x, y, stance, height = (getattr(walk, name)[-1, ids] for name in ("x", "y", "stance", "height"))
    tips = np.stack([x + np.array(stride.geometry.origin), y, np.nan_to_num(height) - 10.0], axis=-1)
    chance, joints, torques, tilt, velocity, turning = np.split(numbers, [6, 24, 42, 44, 47], axis=1)
    contact = stance ^ (chance > 0.96)
    gained, lost = contact & (chance > 0.9), ~contact & (chance > 0.9)
    load = np.where(contact, 9810.0 / np.maximum(contact.sum(axis=1, keepdims=True), 1), 0.0)
    angles, moments = 0.5 * joints.reshape(tips.shape), 1e4 * torques.reshape(tips.shape)
    return Sensed(
        ids.copy(), tips, contact, gained, lost, load, angles, moments, 0.1 * tilt, 80.0 * velocity, turning.copy()
    )
