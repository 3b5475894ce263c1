"""Public entry points reject impossible values with an InputError that names the argument."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.gaits import gait, steady_state_gait
from hexmj.walks import part_of

STARTS = np.zeros((2, 6))
WALK = hexmj.walk(STARTS, hexmj.LDVS, 0.5, 1.0)

CASES: dict[str, tuple[str, Callable[[], Any]]] = {
    "too few starts": ("n_starts", lambda: hexmj.draw_starts(0, seed=0)),
    "negative seed": ("seed", lambda: hexmj.draw_starts(1, seed=-1)),
    "fractional number of starts": ("n_starts", lambda: hexmj.draw_starts(1.5, seed=0)),  # pyright: ignore
    "five legs": ("starts", lambda: hexmj.walk(np.zeros((2, 5)), hexmj.LDVS, 0.5, 10.0)),
    "tip outside the step range": ("starts", lambda: hexmj.walk(STARTS + 11.0, hexmj.LDVS, 0.5, 10.0)),
    "starts that are text": ("starts", lambda: hexmj.walk("abc", hexmj.LDVS, 0.5, 10.0)),  # pyright: ignore
    "velocity of 1": ("velocity", lambda: hexmj.walk(STARTS, hexmj.LDVS, 1.0, 10.0)),
    "velocity of NaN": ("velocity", lambda: hexmj.walk(STARTS, hexmj.LDVS, np.nan, 10.0)),
    "one velocity too many": ("velocity", lambda: hexmj.walk(STARTS, hexmj.LDVS, [0.1, 0.2, 0.3], 10.0)),
    "no time": ("duration", lambda: hexmj.walk(STARTS, hexmj.LDVS, 0.5, 0.0)),
    "no threads": ("threads", lambda: hexmj.walk(STARTS, hexmj.LDVS, 0.5, 10.0, threads=0)),
    "no controller": ("controller", lambda: hexmj.walk(STARTS, "ldvs", 0.5, 10.0)),  # pyright: ignore
    "velocity twice": ("velocities", lambda: hexmj.flss(hexmj.LDVS, [0.5, 0.5], n_starts=2)),
    "no velocity": ("velocities", lambda: hexmj.flss(hexmj.LDVS, [], n_starts=2)),
    "no such observation time": (
        "observation_time",
        lambda: hexmj.flss(hexmj.LDVS, [0.5], n_starts=2, observation_time="long"),
    ),
    "observation time of V = 0": ("velocity", lambda: hexmj.flss(hexmj.LDVS, [0.0], n_starts=2)),
    "acceleration above V": (
        "velocity",
        lambda: hexmj.walk(STARTS, hexmj.LDVS, 0.05, 10.0, acceleration=hexmj.Acceleration()),
    ),
    "negative acceleration": ("rate", lambda: hexmj.Acceleration(rate=-1.0)),
    "AEP behind PEP": ("aep0", lambda: hexmj.Stride(aep0=-20.0)),
    "time step of 0": ("dt", lambda: hexmj.Stride(dt=0.0)),
    "negative lateral distance": ("lateral", lambda: hexmj.Geometry(lateral=(1.0, -1.0, 1.0))),
    "V_p of 0": ("vp", lambda: hexmj.Conditions(vp=0.0)),
    "V_p of NaN": ("vp", lambda: hexmj.Conditions(vp=np.nan)),
    "V_p that is text": ("vp", lambda: hexmj.Conditions(vp="fast")),  # pyright: ignore
    "no such ground": ("ground", lambda: hexmj.Conditions(ground="sand")),  # pyright: ignore
    "step as high as a leg": ("ground_height", lambda: hexmj.Conditions(ground="step", ground_height=40.0)),
    "no body": ("body", lambda: hexmj.Conditions(body=None)),  # pyright: ignore
    "measure of an absent gap": (
        "ground_length",
        lambda: hexmj.physical_walk(STARTS, hexmj.LDVS, 0.5, 10.0, conditions=hexmj.Conditions(ground_length=5.0)),
    ),
    "feet and stance of other shapes": ("stance", lambda: hexmj.stability_margin(np.zeros((6, 2)), np.ones(5, bool))),
    "standing foot at NaN": ("feet", lambda: hexmj.stability_margin(np.full((6, 2), np.nan), np.ones(6, bool))),
    "no such controller": ("controller", lambda: hexmj.load_controller("no-such-controller")),
    "memory": ("memory", lambda: hexmj.walk(np.zeros((10**5, 6)), hexmj.LDVS, 0.3, 1e5)),
    "velocity stepped over": (
        "V = 0.999",
        lambda: hexmj.walk(
            STARTS, hexmj.LDVS, 0.999, 10.0, stride=hexmj.Stride(dt=1.0), acceleration=hexmj.Acceleration(0.01, 0.05)
        ),
    ),
    "gait at V = 0": ("velocity", lambda: steady_state_gait(hexmj.LDVS, 0.0)),
    "gait of few periods": ("periods", lambda: steady_state_gait(hexmj.LDVS, 0.4, periods=3)),
    "gait of one step": ("1 steps", lambda: gait(hexmj.walk(STARTS, hexmj.LDVS, 0.4, 0.1))),
    "five legs of a walk": ("stance", lambda: replace(WALK, stance=np.ones((2, 1, 5), dtype=bool))),
    "times of another walk": ("time", lambda: replace(WALK, time=np.ones(3))),
    "walk of no steps": ("0 steps", lambda: hexmj.loss_time(part_of(WALK, slice(0)))),
    "no controller with feedback": ("controller", lambda: hexmj.SensoryFeedback("ldvs")),  # pyright: ignore
    "no such file": ("does-not-exist", lambda: hexmj.load("does-not-exist.nc")),
    "no such figure": ("which", lambda: hexmj.plot(hexmj.flss(hexmj.LDVS, [0.5], n_starts=2), "map")),
    "no such start": (
        "start",
        lambda: hexmj.record_plan(
            hexmj.walk(STARTS, hexmj.LDVS, 0.5, 10.0), hexmj.Conditions(), hexmj.Stride(), start=2
        ),
    ),
}


@pytest.mark.parametrize(("name", "call"), CASES.values(), ids=CASES)
def test_impossible_values_are_refused(name: str, call: Callable[[], Any]):
    with pytest.raises(hexmj.InputError, match=re.escape(name)):
        call()


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda: hexmj.Conditions(speed=1.0), TypeError),  # pyright: ignore
        (lambda: hexmj.compare(hexmj.LDVS, starts=3), TypeError),  # pyright: ignore
    ],
)
def test_unknown_arguments_are_pythons_own_errors(call: Callable[[], Any], error: type[Exception]):
    with pytest.raises(error):
        call()


def test_numbers_of_numpy_are_numbers():
    usual = hexmj.flss(hexmj.LDVS, [0.5], n_starts=30, seed=4, observation_time=20.0)
    arguments: Any = {"n_starts": np.int64(30), "seed": np.uint8(4), "observation_time": np.float64(20.0)}
    assert hexmj.flss(hexmj.LDVS, np.array([0.5]).tolist(), **arguments).identical(usual)
    assert hexmj.Stride(dt=np.float32(0.25)) == hexmj.Stride(dt=0.25)  # pyright: ignore


def test_states_may_be_given_as_0_and_1():
    feet, stance = WALK.feet[0], WALK.stance[0]
    margin = hexmj.stability_margin(feet, stance)
    assert np.array_equal(hexmj.stability_margin(feet.tolist(), stance.astype(int)), margin)
