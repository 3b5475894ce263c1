"""What a later cell would refuse is refused before the first one, and nothing is kept."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.controllers.planning import check_velocities
from hexmj.controllers.wrappers import LegLost
from hexmj.controllers.wrappers import PoorSenses
from hexmj.environments.learned import WithOffsets
from hexmj.measures.compare import Comparison
from hexmj.measures.kinematic import KinematicFlss
from hexmj.physics.settle import check_adhesion
from hexmj.studies.ablation import Ablation
from hexmj.studies.biology import Biology
from hexmj.studies.disturbance import DisturbedWalks
from hexmj.studies.entrants import Entrant
from hexmj.studies.league import League
from hexmj.studies.stability_map import StabilityMap
from hexmj.studies.terrain import Terrain

DIVERGES = "oscillators diverge at dt = "
STEPPED_OVER = "expected V and a step together below 1"
PRESSES = ": it presses feet"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("flss --model righetti --velocities 0.02 0.9 --dt 0.5", DIVERGES),
        ("flss --model righetti --velocities 0.6 --dt 0.4", DIVERGES),
        ("compare --models ldvs righetti --velocities 0.5 --dt 1", DIVERGES),
        ("terrain --model righetti --velocities 0.1 0.9 --dt 0.5", DIVERGES),
        ("disturb --model righetti --velocities 0.1 0.9 --dt 0.5 --disturbances halt", DIVERGES),
        ("flss --velocities 0.3 0.95 --acceleration 0.6", STEPPED_OVER),
        ("disturb --velocities 0.3 --recovery 10 --disturbances halt", STEPPED_OVER),
        ("disturb --velocities 0.3 --strategies reorganise grasp --adhesion 12", PRESSES),
        ("terrain --grasps 0 50", PRESSES),
        ("map --over load --values 0 10 --grasp 9 --velocities 0.3", PRESSES),
        ("converge --velocity 0.5 --grasp 9.9", PRESSES),
        ("league --grasp 50", PRESSES),
        ("league --grasp 10", "with a load of 1: it presses feet"),
        ("ablate --models ldvs --grasp 50", PRESSES),
        ("search --form hws --velocity 0.5 --physical --grasp 50", PRESSES),
    ],
)
def test_what_ends_the_work_is_said_before_it(run, tmp_path, words: str, said: str) -> None:
    code, _, error = run(*words.split(), "--starts", 3, "--out", tmp_path / "out")
    assert code == 2 and said in error
    assert not [path for path in (tmp_path / "out").rglob("*") if path.is_file()]


@dataclass(frozen=True)
class Counts:
    """LDVS, which knows what it was asked for."""

    begun: list[Any] = field(default_factory=list, compare=False, repr=False)
    name: str = "counts"

    def begin(self, starts: np.ndarray, *how: Any, **others: Any) -> Any:
        self.begun.append(len(starts))
        return hexmj.LDVS.begin(starts, *how, **others)


def test_who_does_not_tell_limits_is_asked_for_nothing_before_the_work() -> None:
    one = Counts()
    lost = KinematicFlss(one, (0.02, 0.9), 20, 10.0).cells()
    assert len(lost) == 2 and one.begun == []


@dataclass(frozen=True)
class Limited(Counts):
    """It plans below V = 0.3 alone."""

    name: str = "limited"

    def check_velocity(self, velocity: float, stride: hexmj.Stride) -> None:
        if not 1 / velocity > 1 / 0.3:
            raise hexmj.InputError(f"V = {velocity}; expected less than 0.3")

    def begin_at_speed(self, *how: Any, **others: Any) -> Any:
        return self.begin(*how, **others)

    def ideal_start(self, velocity: float, stride: hexmj.Stride) -> np.ndarray:
        return hexmj.draw_starts(1, 0, stride)


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
        StabilityMap(LIMITED, values=(40.0,), **FAST),
        Terrain(LIMITED, **FAST),
        DisturbedWalks(LIMITED, disturbances=("push",), impulses=(1.0,), strategies=(), **FAST),
        Biology(LIMITED, n_starts=2),
        Ablation({"limited": {"limited": LIMITED}}, **FAST, n_physical=1),
        Terrain(hexmj.SensoryFeedback(LIMITED), **FAST),
        Terrain(LegLost(LIMITED, 0), **FAST),
        Terrain(PoorSenses(hexmj.SensoryFeedback(LIMITED)), **FAST),
        Terrain(WithOffsets(Still(), LIMITED), **FAST),
        League({"limited": Entrant(LIMITED)}, (0.1,), 2, 1, 1, accelerating=False),
        League({"limited": Entrant(LIMITED)}, (0.1,), 2, 1, 1, tried_at=0.2, accelerating=False),
        League({"limited": Entrant(LIMITED, ideal=True)}, (0.1, 0.3), 2, 1, 1),
    ],
    ids=lambda study: type(study).__name__,
)
def test_every_study_asks_for_limits_before_its_cells(study) -> None:
    begun = len(LIMITED.begun)
    with pytest.raises(hexmj.InputError, match=r"V = 0\.[35]\d*; expected less than 0.3"):
        study.cells()
    assert len(LIMITED.begun) == begun


def test_ideal_entrants_are_asked_for_the_velocities_at_which_they_walk_alone() -> None:
    assert League({"limited": Entrant(LIMITED, ideal=True)}, (0.1,), 2, 1, 1).cells()


def test_adhesion_of_a_start_that_does_not_settle_is_no_matter_of_this_check() -> None:
    check_adhesion(hexmj.Conditions(grasp=1.0, settling_time=3.0), hexmj.Stride(), 0)
    with pytest.raises(hexmj.InputError, match="grasp = 50"):
        check_adhesion(hexmj.Conditions(grasp=50.0), hexmj.Stride(), 0)


def test_what_is_no_method_tells_no_limits() -> None:
    check_velocities(Told(), [0.5], hexmj.Stride())


@dataclass(frozen=True)
class Told(Counts):
    check_velocity: float = 3.0


@dataclass(frozen=True)
class Untold(Counts):
    @property
    def check_velocity(self) -> Any:
        raise ValueError("none")


def test_limits_that_cannot_be_read_are_a_sentence() -> None:
    with pytest.raises(hexmj.InputError, match=r"counts, check_velocity: ValueError in .*: none"):
        check_velocities(Untold(), [0.5], hexmj.Stride())


def test_limits_of_walks_that_accelerate_are_told_as_they_go() -> None:
    accelerating = KinematicFlss(LIMITED, **FAST, acceleration=hexmj.Acceleration())
    assert len(accelerating.cells()) == 2


def test_limits_are_told_whatever_the_controller_raises() -> None:
    with pytest.raises(hexmj.InputError, match=r"limited, check_velocity: ZeroDivisionError"):
        hexmj.flss(LIMITED, [0.0], observation_time=10.0, n_starts=2)


def test_a_load_that_nobody_carries_refuses_no_league() -> None:
    """Entrants from ideal starts take no trials."""
    ideal = Entrant(hexmj.load_controller("graham"), ideal=True)
    league = League({"graham-ideal": ideal}, velocities=(0.5,), conditions=hexmj.Conditions(grasp=10.0))
    assert len(league.cells()) == 2
    tried = replace(league, entrants={"ldvs": Entrant(hexmj.LDVS)})
    with pytest.raises(hexmj.InputError, match=r"grasp = 10; expected at most about 9\.\d with a load of 1"):
        tried.cells()
