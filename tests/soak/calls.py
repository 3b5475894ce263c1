"""Calls of the package's functions and classes with what nobody should pass."""

import inspect
import math
import sys
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import hexmj
from hexmj.errors import RenderingError

STARTS = hexmj.draw_starts(2, 0)
NAMES = tuple(
    name for name in hexmj.__all__ if callable(getattr(hexmj, name)) and name not in ("InputError", "SimulationError")
    and not isinstance(getattr(hexmj, name), hexmj.Cruse1998)
)  # fmt: skip
"""Everything that can be called."""


@cache
def usual() -> dict[str, Any]:
    """Name of a parameter -> a value with which a call ends soon."""
    plan = hexmj.walk(STARTS, hexmj.LDVS, 0.5, 3.0)
    walked = hexmj.physical_walk(STARTS, hexmj.LDVS, 0.5, 3.0)
    return {
        "acceleration": None, "conditions": hexmj.Conditions(), "controller": hexmj.LDVS, "controllers": hexmj.LDVS,
        "duration": 3.0, "feet": np.ones((2, 6, 2)),
        "form": hexmj.NetworkForm("hws"), "high": 0.5, "low": 0.3, "n_starts": 2, "name": "ldvs", "plan": plan,
        "recording": hexmj.record(walked), "recordings": [hexmj.record(walked)], "path": Path("file"), "seed": 0,
        "stance": np.ones((2, 6), dtype=bool), "start": 0, "starts": STARTS, "stride": hexmj.Stride(), "threads": 1,
        "usual": hexmj.LDVS, "velocities": [0.5], "velocity": 0.5, "walk": plan, "weights": hexmj.LDVS.weights,
        "window": 3.0, "walked": walked,
    }  # fmt: skip


ODD: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 3, 10**23, -(10**23), 0.5, -0.0, 1.5, math.nan, math.inf, 1e308, 5e-324, 1j, "",
    "x", "0.5", "walk", "nan", b"x", "a" * 5000, [], [0.5], [[0.5]], ["x"], [None], [math.nan], (), (1, 2, 3), {},
    {"x": 1}, {0.5}, object(), object, len, Fraction(1, 2), np.int64(2), np.float32(0.5), np.bool_(True), np.array(0.5),
    np.array([]), np.array([0.5]), np.array([math.nan]), np.array(["x"]), np.array([1j]), np.zeros((2, 6)),
    np.full((2, 6), math.nan), np.ma.masked_array(np.zeros((2, 6)), True), np.zeros((2, 5)), np.zeros((0, 6)),
    np.zeros((2, 6), dtype=object), np.datetime64("2026-11-22"), range(3), Path("none"), hexmj.HWS, hexmj.Stride(),
    hexmj.Conditions(), hexmj.Acceleration(), hexmj.CENTRED, hexmj.LDVS.weights, hexmj.Film(), hexmj.STICK_INSECT,
)  # fmt: skip


@st.composite
def calls(draw: st.DrawFn) -> tuple[str, tuple[tuple[str, Any], ...]]:
    """The name of what is called, and its arguments by name: one or two of them odd."""
    name = draw(st.sampled_from(NAMES))
    parameters = [
        one for one in inspect.signature(getattr(hexmj, name)).parameters.values() if one.kind is not one.VAR_KEYWORD
    ]
    odd = draw(st.lists(st.sampled_from([one.name for one in parameters] or ["none"]), min_size=1, max_size=2))
    given = {}
    for one in parameters:
        key = "walked" if name == "record" and one.name == "walk" else one.name
        if one.name in odd:
            given[one.name] = draw(st.sampled_from(ODD))
        elif key in usual() and (one.default is one.empty or one.name in ("n_starts", "window", "threads")):
            given[one.name] = usual()[key]
        elif one.default is one.empty:
            given[one.name] = draw(st.sampled_from(ODD))
    return name, tuple(given.items())


def called(call: tuple[str, tuple[tuple[str, Any], ...]]) -> None:
    """What the call does: what it refuses in a sentence ends the process as the command would."""
    name, given = call
    function: Callable[..., Any] = getattr(hexmj, name)
    try:
        function(**dict(given))
    except hexmj.InputError as error:
        print(error, file=sys.stderr)
        raise SystemExit(2) from None
    except (hexmj.SimulationError, RenderingError):
        raise SystemExit(1) from None
