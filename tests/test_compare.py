"""The comparison: one cell for each controller and velocity, cached results, and the same bits on any executor."""

import json
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest

from hexmj import (
    HWS,
    LDVS,
    UNCOORDINATED,
    Acceleration,
    Command,
    Conditions,
    Halt,
    InputError,
    SensoryFeedback,
    Task,
    compare,
    physical_flss,
)
from hexmj.measures import study
from hexmj.measures.compare import Comparison
from hexmj.physics import settle as settling
from hexmj.sweep import Cell, run_study
from hexmj.tasks.runner import TaskStudy
from tiers import few_of

BOTH = {"ldvs": LDVS, "uncoordinated": UNCOORDINATED}
FEW: dict[str, Any] = {"n_starts": 3, "observation_time": 10.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("compare")


@pytest.fixture(scope="module")
def result(folder):
    return compare(BOTH, [0.4, 0.6], **FEW, folder=folder)


@pytest.fixture(scope="module")
def two_processes():
    with ProcessPoolExecutor(2, get_context("spawn")) as executor:
        yield executor


def test_every_controller_and_velocity_is_a_cell(result, folder):
    names = sorted(path.name.rpartition("-")[0] for path in folder.iterdir())
    assert names == ["ldvs-V-0.4", "ldvs-V-0.6", "uncoordinated-V-0.4", "uncoordinated-V-0.6"]
    assert compare(BOTH, [0.4, 0.6], **FEW).identical(result)


def test_only_what_is_missing_is_walked(result, folder, monkeypatch):
    next(folder.glob("uncoordinated-V-0.4-*")).unlink()
    computed, compute = [], Cell.compute
    monkeypatch.setattr(Cell, "compute", lambda cell, **how: (computed.append(cell.name), compute(cell, **how))[1])
    assert compare(BOTH, [0.4, 0.6], **FEW, folder=folder).identical(result)
    assert computed == ["uncoordinated-V-0.4"]
    more = compare(BOTH | {"hws": HWS}, [0.6], **FEW, folder=folder)
    assert computed[1:] == ["hws-V-0.6"]
    assert more.fall.sel(controller="ldvs").equals(result.fall.sel(controller="ldvs", velocity=[0.6]))
    table = physical_flss(LDVS, [0.4, 0.6], **FEW, folder=folder)
    assert np.array_equal(table.flss, result.physical.sel(controller="ldvs"))
    assert computed[1:] == ["hws-V-0.6"]


def test_starts_settle_once(monkeypatch):
    study.settled_starts.cache_clear()
    settled, settle = [], settling.settle
    monkeypatch.setattr(settling, "settle", lambda *given: (settled.append(given), settle(*given))[1])
    compare(BOTH, [0.4, 0.6], **FEW)
    assert len(settled) == 1
    compare(BOTH, [0.4], **FEW, conditions=Conditions(load=0.5))
    assert len(settled) == 2


def test_each_point_of_the_axes_equals_a_run_of_its_own(run, tmp_path):
    axes = {"vp": [320.0, 160.0], "load": [0.0, 0.5]}
    every = compare(BOTH, [0.5, 0.6], **FEW, axes=axes)
    assert every.fall.dims == ("controller", "vp", "load", "velocity", "start")
    points: list[Any] = [{"vp": 160.0, "load": 0.5}, {"vp": 320.0, "load": 0.0}]
    for point in points:
        alone = compare(BOTH, [0.5, 0.6], **FEW, conditions=Conditions(**point))
        part = every.sel(point).drop_vars([*point])
        assert part.assign_attrs(alone.attrs).identical(alone)
    words = "--velocity 0.5 0.6 --starts 3 --observation-time 10 --vp 320 160 --load 0 0.5 --json --out"
    answer = json.loads(run("compare", *words.split(), tmp_path)[1])
    assert answer["vp"] == [320.0, 160.0] and answer["load"] == [0.0, 0.5]
    assert answer["physical"] == every.physical.values.tolist()


TURN = Task("turn", Command(0.0, turn=0.01), duration=30.0)
STUDIES = {
    "compare": Comparison(BOTH, [0.6], **FEW),
    "feedback": Comparison({"feedback": SensoryFeedback(LDVS)}, [0.5, 0.6], **FEW),
    "tasks": TaskStudy([TURN, Task("halt", 0.6, events=(Halt(),), duration=5.0)], BOTH, 2),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(STUDIES, "compare", "feedback"))
def test_processes_and_threads_give_the_same_bits(name, two_processes):
    here = run_study(STUDIES[name], threads=2)
    assert run_study(STUDIES[name], executor=two_processes).identical(here)
    with ThreadPoolExecutor(2) as executor:
        assert run_study(STUDIES[name], executor=executor).identical(here)


@pytest.mark.parametrize(
    ("name", "controllers", "changed"),
    [
        ("controllers", {}, {}),
        ("controller", "ldvs", {}),
        ("controller", [LDVS], {}),
        ("starts", LDVS, {"n_starts": 0}),
        ("seed", LDVS, {"seed": -1}),
        ("observation.time", LDVS, {"observation_time": "long"}),
        ("velocities", LDVS, {"velocities": [0.5, 0.5]}),
        ("velocity", LDVS, {"velocities": [1.0]}),
        ("velocity", LDVS, {"velocities": [0.05], "acceleration": Acceleration()}),
        ("axes", LDVS, {"axes": {"ground": ["flat", "step"]}}),
        ("axes", LDVS, {"axes": {"velocity": [0.5]}}),
        ("vp", LDVS, {"axes": {"vp": []}}),
        ("vp", LDVS, {"axes": {"vp": [40.0, 40]}}),
        ("vp", LDVS, {"axes": {"vp": [40.0, -1.0]}}),
        ("ground_height", LDVS, {"axes": {"ground_height": [1.0]}}),
    ],
)
def test_bad_input_is_refused_before_the_work(tmp_path, name, controllers, changed):
    given: dict[str, Any] = {"velocities": [0.5], "n_starts": 2, "observation_time": 5.0} | changed
    with pytest.raises(InputError, match=name):
        compare(controllers, **given, folder=tmp_path / "walks")
    assert not (tmp_path / "walks").exists()
