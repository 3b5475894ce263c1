"""What a later cell would refuse is refused before the first one, and nothing is cached."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.controllers.wrappers import LegLost, PoorSenses
from hexmj.environments.learned import WithOffsets
from hexmj.measures.compare import Comparison
from hexmj.measures.kinematic import KinematicFlss
from hexmj.studies.biology import Biology
from hexmj.studies.disturbance import DisturbedWalks
from hexmj.studies.league import League
from hexmj.studies.stability_map import StabilityMap
from hexmj.studies.terrain import Terrain


@pytest.mark.parametrize(
    "words",
    [
        "flss --controller righetti --velocity 0.02 0.9 --dt 0.5",
        "compare --controller ldvs righetti --velocity 0.5 --dt 1",
        "flss --velocity 0.3 0.95 --acceleration 0.6",
        "terrain --grasps 0 50",
        "map --over load --values 0 10 --grasp 9 --velocity 0.3",
        "league --grasp 10",
    ],
)
def test_what_ends_the_work_is_refused_before_it(run, tmp_path, words: str) -> None:
    code, _, _ = run(*words.split(), "--starts", 3, "--out", tmp_path / "out")
    assert code == 2
    assert not [path for path in (tmp_path / "out").rglob("*") if path.is_file()]


@dataclass(frozen=True)
class Counts:
    """LDVS, which counts its plans."""

    begun: list[Any] = field(default_factory=list, compare=False, repr=False)
    name: str = "counts"

    def begin(self, starts: np.ndarray, *how: Any, **others: Any) -> Any:
        self.begun.append(len(starts))
        return hexmj.LDVS.begin(starts, *how, **others)


def test_no_plan_begins_before_the_work() -> None:
    controller = Counts()
    cells = KinematicFlss(controller, (0.02, 0.9), 20, 10.0).cells()
    assert len(cells) == 2 and controller.begun == []


@dataclass(frozen=True)
class Limited(Counts):
    """It plans only below V = 0.3."""

    name: str = "limited"

    def check_velocity(self, velocity: float, stride: hexmj.Stride) -> None:
        if not 1 / velocity > 1 / 0.3:
            raise hexmj.InputError(f"V = {velocity}; expected less than 0.3")

    def begin_at_speed(self, *how: Any, **others: Any) -> Any:
        return self.begin(*how, **others)


@dataclass(frozen=True)
class Still:
    """A policy that offsets nothing."""

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        return np.zeros((len(felt), 18))


LIMITED = Limited()
FEW: Any = {"n_starts": 2, "physical_starts": 1, "trial_starts": 1}
FAST: Any = {"velocities": (0.1, 0.3), "n_starts": 2}


@pytest.mark.parametrize(
    "study",
    [
        KinematicFlss(LIMITED, **FAST),
        Comparison({"first": hexmj.LDVS, "limited": LIMITED}, **FAST),
        StabilityMap(LIMITED, values=(40.0,), **FAST),
        Terrain(LIMITED, **FAST),
        DisturbedWalks(LIMITED, disturbances=("push",), impulses=(1.0,), strategies=(), **FAST),
        Biology(LIMITED, n_starts=2),
        Terrain(hexmj.SensoryFeedback(LIMITED), **FAST),
        Terrain(LegLost(LIMITED, 0), **FAST),
        Terrain(PoorSenses(hexmj.SensoryFeedback(LIMITED)), **FAST),
        Terrain(WithOffsets(Still(), controller=LIMITED), **FAST),
        League({"limited": LIMITED}, (0.1, 0.3), **FEW),
        League({"limited": LIMITED}, (0.1,), trial_velocity=0.3, **FEW),
    ],
    ids=lambda study: type(study).__name__,
)
def test_every_study_asks_for_limits_before_its_cells(study) -> None:
    begun = len(LIMITED.begun)
    with pytest.raises(hexmj.InputError, match=r"V = 0\.3"):
        study.cells()
    assert len(LIMITED.begun) == begun


def test_walks_that_accelerate_are_not_refused_before_the_work() -> None:
    accelerating = KinematicFlss(LIMITED, **FAST, acceleration=hexmj.Acceleration())
    assert len(accelerating.cells()) == 2


@pytest.mark.parametrize(
    ("name", "study", "wrong"),
    [
        ("controllers", League, {"controllers": {}}),
        ("load", League, {"conditions": hexmj.Conditions(load=2.0)}),
        ("velocit", League, {"velocities": (0.0, 0.5)}),
        ("periods", League, {"periods": 3}),
        ("periods", Biology, {"periods": 3}),
        ("vp", Biology, {"conditions": hexmj.Conditions(vp=38.0)}),
        ("ground", Biology, {"conditions": hexmj.Conditions(ground="rough")}),
        ("ground_height", Terrain, {"heights": (32.0,)}),
        ("heights", Terrain, {"heights": (2.0, 2.0)}),
        ("velocity", Terrain, {"velocities": (0.0,)}),
        ("over", StabilityMap, {"over": "wind"}),
        ("friction", StabilityMap, {"over": "friction", "values": [-1.0]}),
        ("sensory feedback", StabilityMap, {"controller": hexmj.SensoryFeedback(hexmj.LDVS)}),
        ("disturbances", DisturbedWalks, {"disturbances": ["halt", "halt"]}),
        ("disturbances", DisturbedWalks, {"disturbances": ["push"], "kinematic": True}),
        ("strategies", DisturbedWalks, {"strategies": ["jump"]}),
        ("impulses", DisturbedWalks, {"impulses": [-1.0]}),
        ("velocities", DisturbedWalks, {"velocities": [0.05]}),
        ("observation_time", DisturbedWalks, {"observation_time": 1.9}),
        ("counts", DisturbedWalks, {"controller": Counts()}),
    ],
)
def test_bad_input_is_refused(name: str, study: Any, wrong: dict[str, Any]) -> None:
    one: Any = {"controllers": {"ldvs": hexmj.LDVS}} if study is League else {"controller": hexmj.LDVS}
    with pytest.raises(hexmj.InputError, match=name):
        study(**one | wrong)
