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
from hexmj.tasks.runner import TaskStudy


@pytest.mark.parametrize(
    "words",
    [
        "flss --controller righetti --velocity 0.02 0.9 --dt 0.5",
        "compare --controller ldvs righetti --velocity 0.5 --dt 1",
        "flss --velocity 0.3 0.95 --acceleration 0.6",
        "task fast --controller righetti --dt 1",
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
FAST: Any = {"velocities": (0.1, 0.3), "n_starts": 2}


@pytest.mark.parametrize(
    "study",
    [
        KinematicFlss(LIMITED, **FAST),
        Comparison({"first": hexmj.LDVS, "limited": LIMITED}, **FAST),
        Biology(LIMITED, n_starts=2),
        *(
            TaskStudy([hexmj.Task("t", 0.3)], {"limited": wrapped}, 2)
            for wrapped in (
                LIMITED,
                hexmj.SensoryFeedback(LIMITED),
                LegLost(LIMITED, 0),
                PoorSenses(hexmj.SensoryFeedback(LIMITED)),
                WithOffsets(Still(), controller=LIMITED),
            )
        ),
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
        ("periods", Biology, {"periods": 3}),
        ("vp", Biology, {"conditions": hexmj.Conditions(vp=38.0)}),
        ("axes", Comparison, {"axes": {"wind": (1.0,)}}),
        ("friction", Comparison, {"axes": {"friction": (-1.0,)}}),
        ("controllers", TaskStudy, {"controllers": {}}),
        ("tasks", TaskStudy, {"tasks": [hexmj.Task("t"), hexmj.Task("t")]}),
    ],
)
def test_bad_input_is_refused(name: str, study: Any, wrong: dict[str, Any]) -> None:
    one: Any = {"controller": hexmj.LDVS} if study is Biology else {"controllers": {"ldvs": hexmj.LDVS}}
    one |= {"tasks": [hexmj.Task("t")]} if study is TaskStudy else {}
    with pytest.raises(hexmj.InputError, match=name):
        study(**one | wrong)
