"""Disturbed walks: the starts that are disturbed, the frequencies, the experiment and its command."""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import xarray as xr

from hexmj import HWS, LDVS, Cruse1998, InputError, SensoryFeedback, Stride
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998.weights import general
from hexmj.measures.figures import caption
from hexmj.measures.kinematic import first_loss
from hexmj.studies.disturbance import DisturbedWalks, disturbances, with_flss_after
from hexmj.studies.disturbed_walks import SETTLED, Case, StableWalks, TooFewStable, every_case, find_stable_starts
from hexmj.sweep import run_study
from hexmj.timing import Acceleration

STRIDE, V, GRID = Stride(), 0.5, 20
STABLE = find_stable_starts(LDVS, V, 6, 0, STRIDE, GRID)


def test_starts_are_stable_until_disturbed_and_do_not_depend_on_their_number():
    period = 20 * (1 + 1 / V) / STRIDE.dt
    assert (STABLE.step % GRID == 0).all()
    assert ((STABLE.step >= SETTLED * period) & (STABLE.step < (SETTLED + 1) * period + GRID)).all()
    assert np.isinf(first_loss(STABLE.starts, LDVS, V, STABLE.step * STRIDE.dt)).all()
    more = find_stable_starts(LDVS, V, 50, 0, STRIDE, GRID)
    for name in ("starts", "step", "draw"):
        assert np.array_equal(getattr(more, name)[:6], getattr(STABLE, name))


def test_as_many_starts_are_drawn_as_are_said_to_be(monkeypatch):
    """Of a controller that never keeps stability, in place of the hours that this would take."""
    drawn = []

    def lost(starts, *how, **also):
        drawn.append(len(starts))
        return np.zeros(len(starts))

    monkeypatch.setattr(disturbances, "first_loss", lost)
    monkeypatch.setattr(disturbances, "MOST_DRAWN", 100)
    with pytest.raises(TooFewStable, match="not so many of 100 keep"):
        find_stable_starts(LDVS, 0.9, 30, 0, Stride(), 1)
    assert drawn == [30, 60, 100]
    with pytest.raises(TooFewStable, match="starts = 101;"):
        find_stable_starts(LDVS, 0.9, 101, 0, Stride(), 1)
    assert drawn == [30, 60, 100], "more than are ever drawn are refused at once"


@dataclass(frozen=True)
class Unsure:
    """LDVS that draws random numbers without a seed, from one of the methods by which it begins."""

    method: str
    name: str = "unsure"

    def begin(self, starts, velocity, *how):
        return self._plan("begin", starts, velocity, *how)

    def begin_at_speed(self, starts, velocity, *how):
        return self._plan("begin_at_speed", starts, velocity, *how)

    def _plan(self, method, starts, velocity, *how):
        noise = np.random.default_rng().uniform(0.0, 0.1) if method == self.method else 0.0
        return getattr(LDVS, method)(starts, np.maximum(velocity - noise, 0.0), *how)


@pytest.mark.parametrize("method", ["begin", "begin_at_speed"])
def test_who_begins_otherwise_each_time_is_not_disturbed(method):
    unsure: Any = Unsure(method)
    walks = StableWalks(unsure, V, 3, 0, STRIDE, GRID)
    with pytest.raises(InputError, match="plans another walk when it begins again"):
        walks.times(Case("halt", "none"), 2.0, None, None)


def test_only_losses_after_the_disturbance_and_within_the_window_count():
    #              before, short, between, whole's end, later, never
    lost = [[5.0, 20.0, 31.0, 45.0, 45.1, np.inf], [np.inf, np.inf, np.inf, 12.0, np.inf, np.inf]]
    table = xr.Dataset(
        {
            "time": (("velocity", "case", "start"), np.full((1, 2, 6), 10.0)),
            "back": (("velocity", "case", "start"), np.full((1, 2, 6), 25.0)),
            "planned_loss": (("velocity", "case", "start"), [lost]),
        },
        coords={
            "duration": ("velocity", [20.0]),
            "disturbance": ("case", ["halt", "halt"]),
            "strategy": ("case", ["none", "slow_down"]),
        },
    )
    result = with_flss_after(table).isel(velocity=0)
    assert result.kinematic_reached.values.tolist() == [5, 6]
    np.testing.assert_allclose(result.kinematic.sel(observation_time="short"), [1 / 5, 1 / 6])
    np.testing.assert_allclose(result.kinematic.sel(observation_time="whole"), [3 / 5, 1 / 6])
    np.testing.assert_allclose(result.kinematic_buys.sel(observation_time="whole")[1], 2 / 5)  # of the five that reach both
    assert (result.kinematic_low <= result.kinematic).all() and (result.kinematic <= result.kinematic_high).all()


FEW: dict[str, Any] = {"velocities": [V], "n_starts": 4, "observation_time": 30.0}


@pytest.mark.thorough
def test_disturbed_walks_can_read_their_legs():
    halted: dict[str, Any] = FEW | {
        "disturbances": ["halt"],
        "strategies": ["reorganise"],
        "n_starts": 2,
        "observation_time": 15.0,
    }
    alone, model_variant = (run_study(DisturbedWalks(one, **halted)) for one in (LDVS, SensoryFeedback(LDVS)))
    assert np.isfinite(model_variant.physical.sel(observation_time="whole")).all()
    assert all(model_variant[name].equals(alone[name]) for name in ("time", "back", "planned_loss"))


@pytest.mark.thorough
def test_a_hard_push_fells_and_finished_walks_are_kept(tmp_path):
    pushed: dict[str, Any] = FEW | {"disturbances": ["push"], "strategies": [], "observation_time": 45.0}
    study = DisturbedWalks(LDVS, impulses=[60.0], **pushed)
    result = run_study(study, tmp_path, threads=1)
    assert result.physical_reached.values.tolist() == [[4, 4]]
    assert result.physical.sel(observation_time="whole").values.tolist() == [[0.0, 0.25]]
    assert (result.planned_loss.isel(case=0) == result.planned_loss.isel(case=1)).all()
    files = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert len(files) == 2
    assert run_study(study, tmp_path, threads=2).identical(result)
    assert files == {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    other = run_study(DisturbedWalks(LDVS, impulses=[50.0, 60.0], **pushed), threads=2)
    assert other.fall[0, 2].equals(result.fall[0, 1])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["halt", "leg", "push"])
def test_some_starts_alone_go_as_among_all(kind):
    walks = StableWalks(LDVS, V, 3, 0, STRIDE, GRID)
    asked = Case(kind, "none", 5.0 * (kind == "push")), 5.0, None, Conditions()
    every, alone = walks.times(*asked), walks.times(*asked, which=np.array([2, 0]))
    assert alone.identical(every.isel(start=[2, 0]))


def test_windows_that_hold_no_push_or_recovery_are_refused_before_the_work():
    def study(**other: Any) -> DisturbedWalks:
        return DisturbedWalks(LDVS, **{**FEW, **other})

    with pytest.raises(InputError, match=r"observation time = 1.9, 1.9 time units; expected at least 2, which a push lasts"):
        study(observation_time=1.9)
    study(observation_time=2.0)
    study(observation_time=1.9, disturbances=["halt"])
    slow = Acceleration(rate=1e-7)
    with pytest.raises(InputError, match=r"recovery: V and the observation time after it take .* units; expected at most 1e\+06"):
        study(recovery=slow)
    study(recovery=slow, strategies=["grasp"])
    firm = Conditions(grasp=3.0)
    with pytest.raises(InputError, match="grasp = 3; expected 0, since the strategy 'grasp' has its own, adhesion"):
        study(conditions=firm, strategies=["grasp"])
    study(conditions=firm, strategies=["reorganise"])
    with pytest.raises(InputError, match=r"velocities = \[0.0\]; expected above 0$"):
        study(velocities=[0.0], strategies=[])


def test_strategies_and_feedback_are_not_for_controllers_that_cannot_be_steered():
    frozen: Any = dataclass(frozen=True)(type("Rigid", (), {"name": "rigid", "begin": LDVS.begin}))()
    with pytest.raises(InputError, match="rigid cannot be disturbed; expected a controller whose plans can go on"):
        DisturbedWalks(frozen, **FEW)
    with pytest.raises(InputError, match="rigid cannot be disturbed; expected a controller whose plans can go on"):
        DisturbedWalks(SensoryFeedback(frozen), **FEW)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((["fall"], [], [], True), "none of halt, leg, push"),
        ((["halt", "halt"], [], [], True), "twice"),
        ((["halt"], [], ["jump"], True), "none of reorganise, slow_down, grasp"),
        ((["push"], [-1.0], [], True), "above 0"),
        ((["push"], [np.nan], [], True), "above 0"),
        ((["push"], [], [], True), "at least one"),
        (([], [], [], True), "at least one"),
        ((["push"], [1.0], [], False), "'push' without physics"),
        ((["halt"], [], ["grasp"], False), "'grasp' without physics"),
    ],
)
def test_cases_that_make_no_sense_are_refused(given, said):
    with pytest.raises(InputError, match=said):
        every_case(*given)


def test_any_weights_can_be_disturbed():
    """General weights have no hash."""
    controller = Cruse1998(general(HWS.weights))
    study = DisturbedWalks(controller, disturbances=["halt"], strategies=["reorganise"], physical=False, **FEW)
    result = run_study(study)
    assert np.isfinite(result.kinematic.sel(observation_time="whole")).all()
    assert "V_p" not in caption(result), "nobody has walked"
    assert "V_p" in caption(result.assign_attrs(physical=1))


@pytest.mark.slow
def test_the_command_prints_one_object_and_refuses_with_exit_code_2(tmp_path, run):
    words = ["disturb", "--kinematic", "--velocities", 0.5, "--starts", 20, "--out", tmp_path / "out"]
    code, text, _ = run(*words, "--strategies", "slow_down", "--json")
    assert code == 0
    assert json.loads(text)["strategy"] == ["none", "none", "slow_down", "none", "slow_down"]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "disturb.nc",
        "disturb.png",
        "manifest.json",
        "walks",
    }
    code, text, _ = run(*words, "--strategies", "--json")
    assert json.loads(text)["strategy"] == 3 * ["none"]
    for wrong, said in (
        (["--disturbances", "push"], "expected others, since a plan knows nothing of it"),
        (["--grasp", 1], "Unrecognized options"),
        (["--acceleration", 0.1], "Unrecognized options"),
        (["--recovery", "nan"], "acceleration = nan; expected"),
        (["--friction", 0.5], "--friction with --kinematic; expected"),
        (["--feedback"], "--feedback with --kinematic; expected"),
    ):
        code, _, error = run(*words, *wrong)
        assert code == 2 and said in " ".join(error.split())
