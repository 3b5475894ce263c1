"""A value of the wrong type gets one sentence that names it, wherever it is given; NumPy's scalars are numbers."""

import json
import re
from collections import namedtuple
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj import sweeps
from hexmj.checks import typed
from hexmj.conditions import Ground, Masses, TimeScale
from hexmj.controllers.planning import begin
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.cruse1998.weights import general
from hexmj.controllers.protocol import settings_of
from hexmj.environments import dm
from hexmj.gaits import gait, limit_gait
from hexmj.measures.compare import Comparison
from hexmj.measures.physical import physical_outcomes
from hexmj.paper.protocol import FULL
from hexmj.paper.reproduce import measure
from hexmj.phases import circular_mean, circular_range, unrolled, wilson_phase
from hexmj.physics.settle import settle
from hexmj.search import samples, stages
from hexmj.walks import one_start, part_of

anything: Any = hexmj
LDVS, STRIDE = anything.LDVS, hexmj.Stride()
search: Any = stages.search
Sample: Any = samples.Sample
STARTS = np.zeros((2, 6))
TABLE: Any = xr.Dataset({"x": 1.0})
ANY: Any = None
FEET = np.dstack([np.add.outer([0.0, 0.0], [28.0, 4.0, -20.0] * 2), np.broadcast_to(STRIDE.geometry.y, (2, 6))])
STANDS = np.ones((2, 6), dtype=bool)
FEW: Any = {"n_starts": 2, "observation_time": 10.0}


def walk(starts: Any = STARTS, controller: Any = LDVS, velocity: Any = 0.3, duration: Any = 5.0, **options: Any):
    return hexmj.walk(starts, controller, velocity, duration, **options)


def first_loss(starts: Any = STARTS, controller: Any = LDVS, velocity: Any = 0.3, duration: Any = 5.0, **options: Any):
    return hexmj.first_loss(starts, controller, velocity, duration, **options)


def flss(controller: Any = LDVS, velocities: Any = (0.3,), **options: Any):
    return hexmj.flss(controller, velocities, **FEW | options)


def over_range(low: Any = 0.1, high: Any = 0.5, **options: Any):
    return hexmj.flss_over_range(LDVS, low, high, **FEW | options)


def compare(controllers: Any = LDVS, velocities: Any = (0.3,), **options: Any):
    return hexmj.compare(controllers, velocities, **FEW | options)


def physical_walk(duration: Any = 5.0, **options: Any):
    return hexmj.physical_walk(STARTS, LDVS, 0.3, duration, **options)


def environment_step(action: Any) -> None:
    environment = dm.load(0.3, actions="tips", duration=5.0)
    environment.reset()
    environment.step(action)


def plan_recorded(part: slice = slice(None), stride: Any = None) -> Any:
    return hexmj.record_plan(part_of(walk(), part), hexmj.Conditions(), stride or hexmj.Stride())


def save(**attributes: Any) -> None:
    with TemporaryDirectory() as folder:
        hexmj.save_recording(hexmj.record(physical_walk()).assign_attrs(attributes), Path(folder) / "recording.nc")


def of_centred_lines() -> Any:
    return hexmj.record_plan(walk(), hexmj.Conditions(), hexmj.Stride(geometry=hexmj.CENTRED))


def nan_tips() -> Any:
    walked = walk()
    return replace(walked, x=np.full_like(walked.x, np.nan))


PROBLEM = anything.Problem(hexmj.NetworkForm("hws"), 0.3, 0.3)
MASKED = np.ma.masked_less(np.linspace(-5.0, 5.0, 12).reshape(2, 6), 0.0)

BAD: list[tuple[Callable[[], Any], str]] = [
    (lambda: anything.Stride(dt=np.timedelta64(1)), "dt = np.timedelta64(1); expected a number"),
    (lambda: circular_range([0.95, 0.05]), "phase has the shape (2,); expected (row, n), rows of at least one"),
    (lambda: sweeps.conduct(ANY), "study = None; expected one that has cells and a result"),
    (lambda: sweeps.conduct(Comparison), "study = <class 'hexmj.measures.compare.Comparison'>; "),  # pyright: ignore
    (lambda: sweeps.over_axes({"a": 0}, []), "size of a = 0; expected a whole number of at least 1"),
    (lambda: sweeps.KeptValues(ANY), "cell = None; expected a Cell"),
    (lambda: circular_range(0.5), "phase has the shape (); expected (row, n)"),
    (lambda: circular_range(np.empty((2, 0))), "phase has the shape (2, 0); expected (row, n)"),
    (lambda: unrolled("gait"), "phase = 'gait'; expected numbers"),
    (lambda: walk(TABLE), "starts = <xarray.Dataset>"),
    (lambda: walk(velocity=TABLE), "velocity = <xarray.Dataset>"),
    (lambda: hexmj.stability_margin(np.zeros((1, 6, 2)), TABLE), "stance = <xarray.Dataset>"),
    (lambda: replace(walk(), stance=TABLE), "a walk's stance = <xarray.Dataset>"),
    (lambda: walk(stride=3), "stride = 3; expected a Stride"),
    (lambda: walk(stride={}), "stride = {}; expected a Stride"),
    (lambda: walk(stride=0), "stride = 0; expected a Stride"),
    (lambda: walk(acceleration=0.1), "acceleration = 0.1; expected an Acceleration or None"),
    (lambda: walk(acceleration=False), "acceleration = False; expected an Acceleration or None"),
    (lambda: walk(duration=-4), "duration = -4; expected at least one step, 0.1, and at most 1e+06 time units"),
    (lambda: walk(duration="x"), "duration = 'x'; expected a number"),
    (lambda: walk(duration=None), "duration = None; expected a number"),
    (lambda: walk(duration=True), "duration = True; expected a number"),
    (lambda: walk(duration=[5.0, 6.0]), "duration = [5.0, 6.0]; expected a number"),
    (lambda: walk(velocity="fast"), "velocity = 'fast'; expected numbers"),
    (lambda: walk(velocity=True), "velocity = True; expected numbers"),
    (lambda: walk(velocity=None), "velocity = None; expected numbers"),
    (lambda: walk(velocity=0.3 + 1j), "velocity = (0.3+1j); expected numbers"),
    (lambda: walk(velocity=[[0.1], [0.1, 0.2]]), "velocity = [[0.1], [0.1, 0.2]]; expected numbers"),
    (lambda: walk(starts="none"), "starts = 'none'; expected numbers"),
    (lambda: walk(starts=STARTS > 0), "starts = array([[False, False, "),
    (lambda: walk(starts=STARTS + 1j), "starts = array([[0.+1.j, "),
    (lambda: walk(starts=MASKED), "starts = masked_array( data=[[--, --, --, "),
    (lambda: walk(starts=[[1.0], [1.0, 2.0]]), "starts = [[1.0], [1.0, 2.0]]; expected numbers"),
    (lambda: walk(starts=[[{}] * 6]), "starts = [[{}, {}, {}, {}, {}, {}]]; expected numbers"),
    (
        lambda: walk(threads=1.5),
        "threads = 1.5; expected a whole number of at least 1 and at most 1000, or nothing for",
    ),
    (lambda: walk(threads=True), "threads = True; expected a whole number of at least 1"),
    (lambda: walk(threads="two"), "threads = 'two'; expected a whole number of at least 1"),
    (lambda: walk(controller="ldvs"), "controller = 'ldvs'; expected a controller"),
    (lambda: first_loss(duration="x"), "duration = 'x'; expected numbers"),
    (lambda: first_loss(duration=[True, False]), "duration = [True, False]; expected numbers"),
    (lambda: first_loss(stride="fig1"), "stride = 'fig1'; expected a Stride"),
    (lambda: compare(threads=[1]), "threads = [1]; expected a whole number of at least 1"),
    (lambda: walk(controller=np.ones((2, 2))), "controller = array([[1., 1.], [1., 1.]]); expected a controller"),
    (lambda: hexmj.load("\ud800.nc"), r"path = '\ud800.nc'; expected characters that names of files can have"),
    (lambda: flss(folder="\ud800"), r"path = '\ud800'; expected characters that names of files can have"),
    (lambda: first_loss(threads=0.5), "threads = 0.5; expected a whole number of at least 1"),
    (lambda: first_loss(acceleration=STRIDE), "acceleration = Stride(aep0=10.0,"),
    (lambda: begin(LDVS, STARTS, 0.3, anything), "stride = <module 'hexmj'"),
    (lambda: flss(n_starts=2.0), "starts = 2.0; expected a whole number of at least 1 and at most 10000000000"),
    (lambda: flss(n_starts=True), "starts = True; expected a whole number of at least 1"),
    (lambda: flss(n_starts="7000"), "starts = '7000'; expected a whole number of at least 1"),
    (lambda: flss(n_starts=None), "starts = None; expected a whole number of at least 1"),
    (lambda: flss(seed=True), "seed = True; expected a whole number of at least 0"),
    (lambda: flss(seed=0.0), "seed = 0.0; expected a whole number of at least 0"),
    (lambda: flss(seed=None), "seed = None; expected a whole number of at least 0"),
    (lambda: flss(observation_time=None), "observation time = None; expected a text or a number"),
    (lambda: flss(observation_time=True), "observation time = True; expected a text or a number"),
    (lambda: flss(observation_time=[10.0]), "observation time = [10.0]; expected a text or a number"),
    (lambda: flss(velocities="0.3"), "velocities = '0.3'; expected numbers"),
    (lambda: flss(velocities=[True]), "velocities = [True]; expected numbers"),
    (lambda: flss(velocities=None), "velocities = None; expected numbers"),
    (lambda: flss(stride=[]), "stride = []; expected a Stride"),
    (lambda: flss(progress=3), "progress = 3; expected a function or True or False or None"),
    (lambda: flss(controller=None), "controller = None; expected a controller"),
    (lambda: over_range(low="a"), "low = 'a'; expected a number"),
    (lambda: over_range(high=None), "high = None; expected a number"),
    (lambda: over_range(seed=1.5), "seed = 1.5; expected a whole number"),
    (lambda: over_range(stride=3), "stride = 3; expected a Stride"),
    (lambda: hexmj.draw_starts(anything, 0), "starts = <module 'hexmj'"),
    (lambda: hexmj.draw_starts(3, np.bool_(True)), "seed = np.True_; expected a whole number"),  # pyright: ignore
    (lambda: hexmj.draw_starts(3, 0, "fine"), "stride = 'fine'; expected a Stride"),  # pyright: ignore
    (lambda: limit_gait(LDVS, "fast"), "velocity = 'fast'; expected a number"),  # pyright: ignore
    (lambda: limit_gait(LDVS, 0.5, periods=20.5), "periods = 20.5; expected a whole number"),  # pyright: ignore
    (lambda: limit_gait(LDVS, 0.5, stride=3), "stride = 3; expected a Stride"),  # pyright: ignore
    (lambda: one_start(walk(), 0.5), "start = 0.5; expected a whole number"),  # pyright: ignore
    (lambda: one_start(walk(), True), "start = True; expected a whole number"),
    (lambda: hexmj.Stride(aep0="10"), "aep0 = '10'; expected a number"),  # pyright: ignore
    (lambda: hexmj.Stride(dt=True), "dt = True; expected a number"),
    (lambda: hexmj.Stride(dt=None), "dt = None; expected a number"),  # pyright: ignore
    (lambda: hexmj.Stride(geometry="fig1"), "geometry = 'fig1'; expected a Geometry"),  # pyright: ignore
    (lambda: hexmj.Acceleration(rate="slow"), "rate = 'slow'; expected a number"),  # pyright: ignore
    (lambda: hexmj.Acceleration(start=False), "start = False; expected a number"),
    (lambda: hexmj.Geometry(origins=(1.0, 2.0)), "origins = (1.0, 2.0); expected 3 values, each a number"),  # pyright: ignore
    (lambda: hexmj.Geometry(lateral=18.0), "lateral = 18.0; expected 3 values, each a number"),  # pyright: ignore
    (lambda: hexmj.Geometry(lateral=(1, 2, "3")), "lateral = (1, 2, '3'); expected 3 values"),  # pyright: ignore
    (lambda: hexmj.Symmetric(p1_i="10"), "p1_i = '10'; expected a number"),  # pyright: ignore
    (lambda: hexmj.Symmetric(p2=True), "p2 = True; expected a number"),
    (lambda: hexmj.Cruse1998("hws"), "weights = 'hws'; expected a Symmetric or a Weights"),  # pyright: ignore
    (lambda: replace(LDVS, order=1), "order = 1; valid names: printed, undelayed, sequential"),
    (lambda: replace(LDVS, name=3), "name = 3; expected a text"),
    *(
        (lambda key=key: hexmj.Weights.of({key: 1.0}), f"a weight's key = {key}; expected 2 values")  # pyright: ignore
        for key in (("p1", (1.0, 0.0)), ("p1", (False, 1)), ("p1", 3))
    ),
    *(
        (lambda key=key: hexmj.Weights.of({key: 1.0}), f"{key} has no weight; expected one of p1, p2, ")  # pyright: ignore
        for key in (("p9", (0, 1)), ("p1", (6, 1)), ("p1", (-6, -5)))
    ),
    (lambda: hexmj.NetworkForm("ldvs").vector("x"), "controller = 'x'; expected a controller"),  # pyright: ignore
    (lambda: hexmj.Weights.of({("p1", (0, 1)): "a"}), "p1 (0, 1) = 'a'; expected a number"),  # pyright: ignore
    (lambda: hexmj.Weights.of([1]), "numbers = [1]; expected a dict"),  # pyright: ignore
    (lambda: hexmj.LDVS.weights.to_vector(7), "size = 7; expected 9 or 10"),  # pyright: ignore
    (lambda: LDVS.weights.to_vector(np.array([9, 10])), "size = array([ 9, 10]); expected a whole number"),
    (lambda: general(hexmj.LDVS.weights).to_vector(10), "size = 10; expected 48 or 58"),  # pyright: ignore
    (lambda: hexmj.Weights.from_vector(["0"] * 58), "weights = ['0', '0', "),  # pyright: ignore
    (lambda: hexmj.SensoryFeedback("ldvs"), "controller = 'ldvs'; expected a controller"),  # pyright: ignore
    (lambda: hexmj.Conditions(time=3), "time = 3; expected a TimeScale"),  # pyright: ignore
    (lambda: hexmj.Conditions(body="insect"), "body = 'insect'; expected a Body"),  # pyright: ignore
    (lambda: hexmj.Conditions(vp="80"), "vp = '80'; expected a number"),
    (lambda: hexmj.Conditions(load=True), "load = True; expected a number"),
    (lambda: hexmj.Conditions(ground=3), "ground = 3; valid names: flat, step, gap, hurdle, rough"),
    (lambda: hexmj.Conditions(ground_seed=1.0), "ground_seed = 1.0; expected a whole number"),
    (lambda: TimeScale(vp=None), "vp = None; expected a number"),  # pyright: ignore
    (lambda: Masses(load=[1.0]), "load = [1.0]; expected a number"),  # pyright: ignore
    (lambda: Ground(ground="sand"), "ground = 'sand'; valid names: flat"),  # pyright: ignore
    (lambda: compare(conditions=3), "conditions = 3; expected a Conditions"),
    (lambda: compare(conditions={}), "conditions = {}; expected a Conditions"),
    (lambda: compare(stride={}), "stride = {}; expected a Stride"),
    (lambda: compare(acceleration=0), "acceleration = 0; expected an Acceleration or None"),
    (lambda: compare(n_starts=1.5), "n_starts = 1.5; expected a whole number"),
    (lambda: compare(seed=True), "seed = True; expected a whole number"),
    (lambda: compare(observation_time=None), "observation time = None; expected a text or a number"),
    (lambda: compare(controllers=3), "controller = 3; expected a controller"),
    (lambda: compare(controllers={"a": 3}), "controller = 3; expected a controller"),
    (lambda: Comparison(LDVS), "controllers = Cruse1998("),
    (lambda: physical_walk(conditions={}), "conditions = {}; expected a Conditions"),
    (lambda: physical_walk(stride=3), "stride = 3; expected a Stride"),
    (lambda: physical_walk(duration="x"), "duration = 'x'; expected a number"),
    (lambda: physical_walk(progress=3), "progress = 3; expected a function or True or False or None"),
    (lambda: physical_outcomes(settle(STARTS), LDVS, 0.3, "x"), "duration = 'x'; expected a number"),  # pyright: ignore
    (lambda: check_controller(LDVS, 3), "stride = 3; expected a Stride"),  # pyright: ignore
    (lambda: hexmj.loss_time(nan_tips()), "a foot that stands is at NaN or infinity"),
    (lambda: hexmj.stability_margin(np.where(FEET > 0, np.nan, FEET), STANDS), "a foot that stands is at NaN"),
    (lambda: hexmj.stability_margin(FEET + 1j, STANDS), "feet = array([[[ 28.+1.j, "),
    (lambda: hexmj.stability_margin(FEET, STANDS * 0.5), "stance = array([[0.5, 0.5,"),
    (lambda: hexmj.stability_margin(FEET, [["no"] * 6] * 2), "stance = [['no', 'no',"),
    (lambda: hexmj.stability_margin(np.ma.masked_greater(FEET, 20.0), STANDS), "feet = masked_array("),
    (lambda: hexmj.stability_margin(FEET, np.ma.masked_array(STANDS, STANDS)), "stance = masked_array("),
    (lambda: hexmj.stability_margin(FEET, STANDS, threads=1.5), "threads = 1.5; expected a whole number"),  # pyright: ignore
    (lambda: hexmj.loss_time(STARTS), "walk = array([[0., 0., "),  # pyright: ignore
    (lambda: gait(3), "walk = 3; expected a Walk"),  # pyright: ignore
    (lambda: circular_mean([0.1 + 1j]), "phase = [(0.1+1j)]; expected numbers"),  # pyright: ignore
    (lambda: wilson_phase("slow"), "velocity = 'slow'; expected numbers"),  # pyright: ignore
    (lambda: wilson_phase([0.5, -1.0]), "velocity = [0.5, -1.0]; expected 0 <= V <= 1"),
    (lambda: circular_mean(np.empty((0, 4)), axis=0), "phase = array([]"),
    (lambda: circular_mean([]), "phase = []; expected at least one"),
    (lambda: hexmj.load_controller(3), "name = 3; expected a text"),  # pyright: ignore
    (lambda: compare(folder=3), "folder = 3; expected a Path or a text or None"),
    (lambda: hexmj.support_polygon("feet", STANDS[0]), "feet = 'feet'; expected numbers"),
    (lambda: hexmj.support_polygon(FEET[0] * np.nan, STANDS[0]), "a foot that stands is at NaN or infinity"),
    (lambda: settle(STARTS, {}), "conditions = {}; expected a Conditions"),  # pyright: ignore
    (lambda: settle(STARTS, None, 0), "stride = 0; expected a Stride"),  # pyright: ignore
    (lambda: dm.load(conditions={}), "conditions = {}; expected a Conditions"),  # pyright: ignore
    (lambda: dm.load(stride=[]), "stride = []; expected a Stride"),  # pyright: ignore
    (lambda: dm.load("0.3"), "velocity = '0.3'; expected a number"),  # pyright: ignore
    (lambda: dm.load(actions=[]), "actions = []; valid names: joints, tips"),  # pyright: ignore
    (lambda: dm.load(duration=[10.0, 20.0]), "duration = [10.0, 20.0]; expected a number"),  # pyright: ignore
    (lambda: dm.load(controller="ldvs"), "controller = 'ldvs'; expected a controller"),  # pyright: ignore
    (lambda: environment_step(np.zeros(18) + 1j), "action = array([0.+1.j, "),
    (lambda: environment_step(["0.1"] * 18), "action = ['0.1', "),
    (lambda: hexmj.loss_time(replace(walk(), time=np.ones(3))), "a walk's time is float64 of the shape (3,); expected"),
    (lambda: hexmj.loss_time(replace(walk(), x="no")), "a walk's x = 'no'; expected an array"),
    (lambda: hexmj.loss_time(replace(walk(), geometry=3)), "geometry = 3; expected a Geometry"),
    (lambda: hexmj.loss_time(part_of(walk(), slice(0))), "a walk of 0 steps; expected at least 1"),
    (
        lambda: replace(walk(), stance=np.ones((2, 6), bool)),
        "a walk's stance is of the shape (2, 6); expected (step, start, leg)",
    ),
    (
        lambda: replace(walk(), stance=np.ones((2, 1, 5), bool)),
        "a walk's stance is of 5 legs; expected 6",
    ),
    (
        lambda: plan_recorded(stride=hexmj.Stride(dt=0.2)),
        "the plan's 50 times are not those of its first steps; expected multiples of 0.2",
    ),
    (lambda: plan_recorded(slice(0)), "the plan's 0 times are not those of its first steps; expected multiples of 0.1"),
    (
        lambda: plan_recorded(slice(1, None)),
        "the plan's 49 times are not those of its first steps; expected multiples of 0.1",
    ),
    *(
        (
            lambda name=name: hexmj.record_plan(
                replace(walk(), **{name: getattr(walk(), name) * np.nan}), hexmj.Conditions(), hexmj.Stride()
            ),
            "plan: a walk of which no more is known from a fall on; expected a plan to its end",
        )
        for name in ("x", "y", "velocity")
    ),
    (
        lambda: hexmj.save_recording(plan_recorded(), "~/kept.nc"),
        "path = '~/kept.nc'; expected the path of the folder for",
    ),
    (lambda: hexmj.save_recording(plan_recorded(), "/dev/full"), "/dev/full is a pipe or a device; expected a file"),
    (lambda: hexmj.render([plan_recorded()], "x\0.mp4"), "path = 'x\\x00.mp4'; expected one without a null"),
    (lambda: compare(folder=""), "path = ''; expected a name, or '.' for the current folder"),
    (lambda: hexmj.flss(replace(LDVS, name=["a"]), [0.5]), "name = ['a']; expected a text"),
    (
        lambda: hexmj.flss(replace(LDVS, name="a\nb"), [0.5]),
        "a controller's name = 'a\\nb'; expected 1 to 200 printable",
    ),
    (
        lambda: walk(velocity=0.999, stride=hexmj.Stride(dt=1.0), acceleration=hexmj.Acceleration(0.01, 0.05)),
        "V = 0.999 is reached in steps of 0.01; expected V and a step together below 1",
    ),
    (lambda: compare({"a\nb": LDVS}), "a controller's name = 'a\\nb'; expected 1 to 200 printable characters"),
    (lambda: compare({1: LDVS}), "a controller's name = 1; expected a text"),
    (lambda: compare(executor=3), "executor = 3; expected an Executor or None"),
    (lambda: compare(progress=object), "progress = <class 'object'>; expected a function or True or False or None"),
    (lambda: compare(progress=3), "progress = 3; expected a function or True or False or None"),
    (
        lambda: hexmj.walk(np.zeros((10**5, 6)), LDVS, 0.3, 1e5),
        "1000000 steps of 100000 starts, kept whole, take",
    ),
    (lambda: compare(folder="a\0b"), "path = 'a\\x00b'; expected one without a null character"),
    (lambda: save(title="two\nlines"), "no recording: title = 'two\\nlines'; expected at most 1000 printable"),
    (lambda: anything.Problem("ldvs", 0.3, 0.3), "form = 'ldvs'; expected a frozen dataclass such as NetworkForm"),
    (
        lambda: anything.Problem(hexmj.NetworkForm, 0.3, 0.3),
        "form = <class 'hexmj.search.",
    ),
    (lambda: anything.Effort(begin="ldvs"), "controller = 'ldvs'; expected a controller"),
    (lambda: anything.Effort(starts=0), "starts = 0; expected a whole number of at least 1"),
    (lambda: anything.Effort(seed=-1), "seed = -1; expected a whole number of at least 0"),
    (lambda: anything.Effort(population=10**12, budget=10**12), "population = 1000000000000; expected a whole number"),
    (lambda: search(3, anything.Effort()), "problem = 3; expected a Problem"),
    (lambda: search(PROBLEM, 3), "effort = 3; expected an Effort"),
    (lambda: search(PROBLEM, anything.Effort(), folder=3), "path = 3; expected a Path or a text"),
    (lambda: search(PROBLEM, anything.Effort(domain=1e308)), "domain = 1e+308; expected above 0 and at most"),
    (lambda: Sample(PROBLEM, 3, 0).costs(np.zeros(10)), "vectors of the shape (10,); expected (candidate, parameter)"),
    (lambda: Sample(3, 1, 0), "problem = 3; expected a Problem"),
    (lambda: save(extra=None), "NetCDF cannot hold this: "),
    (lambda: save(extra={"a": 1}), "NetCDF cannot hold this: "),
    (lambda: of_centred_lines(), "the plan's lines are Geometry("),
    (lambda: hexmj.physical_flss({"u": LDVS}, 0.5), "controller = {'u': "),  # pyright: ignore
    (lambda: replace(FULL, looks="step"), "looks = 'step'; valid names: steps, periods"),
    (lambda: replace(FULL, stride=0.1), "stride = 0.1; expected a Stride"),
    (lambda: replace(FULL, velocities=()), "velocities = (); expected a list of numbers, at least one"),
    (lambda: replace(FULL, samples=0), "samples = 0; expected a whole number of at least 1"),
    (lambda: measure("typo", FULL), "measurement 'typo'; valid names: "),
]


@pytest.mark.parametrize(("call", "words"), BAD, ids=[words[:40] for _, words in BAD])
def test_a_wrong_type_gets_one_sentence(call: Callable[[], Any], words: str):
    with pytest.raises(hexmj.InputError, match=f"^{re.escape(words)}") as wrong:
        call()
    sentence = str(wrong.value)
    assert "\n" not in sentence
    assert re.search("; expected |; valid names: ", sentence)


def test_numbers_of_numpy_are_numbers():
    """And stand in settings as Python's own."""
    for both in (flss(velocities=[0.3, 0.5]).velocity, namedtuple("Two", "one values")(0.3, 0.5)):
        assert compare(velocities=both).velocity.values.tolist() == [0.3, 0.5]
    usual = flss(n_starts=30, seed=4, observation_time=20.0, velocities=[0.5])
    given = flss(n_starts=np.int64(30), seed=np.uint8(4), observation_time=np.float64(20.0), velocities=np.array([0.5]))
    assert given.equals(usual)
    assert json.dumps(given.attrs) == json.dumps(usual.attrs)
    assert type(hexmj.Conditions(ground=np.str_("rough")).ground) is str
    assert type(hexmj.Cruse1998(hexmj.LDVS.weights, name=np.str_("own")).name) is str
    assert flss(n_starts=3, velocities=np.array(0.5)).identical(flss(n_starts=3, velocities=0.5))
    assert flss(n_starts=3, observation_time=np.str_("start")).identical(flss(n_starts=3, observation_time="start"))
    assert hexmj.Conditions(vp=np.float32(40.0), ground_seed=np.int32(2)).values()["vp"] == 40.0
    stride = hexmj.Stride(dt=np.float32(0.25), geometry=hexmj.Geometry(origins=np.array([24, 0, -24])))  # pyright: ignore
    assert stride == hexmj.Stride(dt=0.25, geometry=hexmj.CENTRED)
    assert json.dumps(settings_of(replace(LDVS, weights=hexmj.Symmetric(np.float32(2.0)))))  # pyright: ignore
    assert np.array_equal(first_loss(threads=np.int64(1)), first_loss())
    few: Any = {"observation_time": 2.0, "threads": 1}
    falls = hexmj.physical_flss(LDVS, [0.3], n_starts=np.int8(2), **few)  # pyright: ignore
    assert falls.identical(hexmj.physical_flss(LDVS, [0.3], n_starts=2, **few))
    assert one_start(walk(), np.int64(1)).x.shape == (50, 1, 6)  # pyright: ignore


def test_states_may_be_given_as_0_and_1():
    margin = hexmj.stability_margin(FEET, STANDS)
    assert np.array_equal(hexmj.stability_margin(FEET.tolist(), STANDS.astype(int)), margin)
    assert np.array_equal(hexmj.stability_margin(np.asfortranarray(FEET), np.ma.masked_array(STANDS)), margin)


@pytest.mark.parametrize(
    ("value", "wanted", "kept"),
    [
        (np.float64(2.0), int | float, 2.0),
        (np.bool_(True), bool | None, True),
        (None, bool | None, None),
        ([1, 2], tuple[int, ...], (1, 2)),
        (Path("a"), Path, Path("a")),
    ],
)
def test_what_fits_is_kept(value, wanted, kept):
    found = typed("value", value, wanted)
    assert found == kept
    assert type(found) is type(kept)
