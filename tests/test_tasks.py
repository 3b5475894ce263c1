"""Tasks and their runner: TOML files, events with every controller, outcomes, and refused starts."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

import hexmj
from hexmj import LDVS, Command, CommandChange, Conditions, Halt, InputError, LegLost, LegStopped, Push, Task, Terrain
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.registry import load_controller
from hexmj.controllers.wrappers import RISE, PoorSenses
from hexmj.controllers.wrappers import LegLost as WithoutLeg
from hexmj.errors import OutOfReach, SimulationError, StillThrown
from hexmj.tasks.league import EVERYONE, TASKS, cost_figure, entrants, league_markdown, matrix_figure
from hexmj.tasks.outcomes import recovery_times
from hexmj.tasks.runner import TaskStudy, TaskWalks, by_halves, run_task
from hexmj.tasks.task import known_tasks, load_task
from hexmj.timing import Stride
from standing_still import Still, Stretched

EVENTS = {
    "push": Push(5.0, 5.0),
    "halt": Halt(5.0),
    "reorganise": Halt(30.0, answer="reorganise"),
    "slow down": Halt(5.0, answer="slow_down", recovery=0.05),
    "leg stopped": LegStopped(5.0),
    "leg lost": LegLost(2, 5.0, announced=True),
    "command change": CommandChange(5.0, 0.1, 0.1, 0.002),
}
STABLE = ("ldvs", "graham", "wilson", "evolved", "walknet", "free", "own-0.5", "lasting")
"""Controllers with a stable gait at V = 0.3, which the answer 'reorganise' needs."""


def short_walk(controller: Any, task: Task, n_starts: int = 2) -> xr.Dataset:
    return TaskWalks(controller, task, n_starts, 0, Stride(dt=0.5)).outcomes(threads=1)


@pytest.mark.parametrize("name", EVERYONE)
@pytest.mark.parametrize("event", EVENTS)
def test_every_event_works_with_every_controller(name: str, event: str) -> None:
    if event == "reorganise" and name not in STABLE:
        pytest.skip("needs a stable gait")
    found = short_walk(load_controller(name), Task("t", 0.3, events=(EVENTS[event],), duration=40.0))
    assert not found.refused.any()
    assert np.isfinite(found.tilt).all() and np.isfinite(found.margin).all()


@pytest.mark.parametrize("event", ["halt", "leg stopped", "push"])
def test_events_work_with_feedback_on_a_curve(event: str) -> None:
    curve = Command(0.2, 0.05, 0.002)
    task = Task("t", curve, events=(EVENTS[event], LegLost(5, 20.0)), duration=40.0, noise=0.02, delay=1.0)
    assert not short_walk(LDVS, task).refused.any()


def test_a_task_without_anything_special_is_a_physical_walk() -> None:
    task = Task("t", 0.4, duration=60.0)
    found, walk = (
        TaskWalks(LDVS, task, 3, 1, Stride()).outcomes(),
        hexmj.physical_walk(hexmj.draw_starts(3, 1), LDVS, 0.4, 60.0),
    )
    for name in ("fall", "planned_loss", "grounded_loss", "carried_loss", "speed", "tilt", "slip"):
        assert np.array_equal(found[name], getattr(walk.outcomes, name), equal_nan=True)
    ahead = walk.qpos[-1, :, 0]
    upright = np.isinf(walk.outcomes.fall)
    assert_allclose(found.way[upright], ahead[upright], atol=0.5)


def test_results_depend_neither_on_threads_nor_on_other_starts() -> None:
    task = Task("t", Command(0.2, turn=0.003), events=(Push(20.0, 3.0), LegStopped(10.0)), duration=50.0)
    two, four = (TaskWalks(LDVS, task, n, 1, Stride(dt=0.5)).outcomes(threads) for n, threads in ((2, 1), (4, 2)))
    assert two.drop_attrs().identical(four.isel(start=[0, 1]).assign(drawn=2).drop_attrs())


def test_random_events_happen_in_walks_that_are_stable_until_then() -> None:
    task = Task("t", 0.5, events=(Halt(),), duration=20.0)
    found = TaskWalks(LDVS, task, 4, 0, Stride()).outcomes()
    period = Stride().periods(0.5)
    assert ((found.event >= 3 * period) & (found.event <= 4 * period + 2.0)).all()
    assert (found.planned_loss > found.event).all() and found.drawn >= 4
    assert_allclose(found.back - found.event, 4.0)


def test_a_change_of_command_is_a_part_of_the_command() -> None:
    changed = Task("t", 0.3, events=(CommandChange(30.0, 0.1, turn=0.004),))
    table = Task("t", Command((0.3, 0.1), 0.0, (0.0, 0.004), (0.0, 30.0)))
    assert changed.whole_command.changes(Stride()).keys() == table.whole_command.changes(Stride()).keys()
    assert np.array_equal(changed.whole_command.parts, table.whole_command.parts)


def test_falls_before_an_event_do_not_count() -> None:
    result = run_task(Task("t", 0.8, events=(LegLost(0, 60.0),), duration=120.0), LDVS, n_starts=6)
    before = result.fall <= 60.0
    assert before.any()
    assert result.fell_starts.item() == (~before).sum()


def test_the_starts_that_cannot_walk_are_refused_and_the_others_walk() -> None:
    task = Task("t", 0.5, duration=10.0)
    found, still = (TaskWalks(one, task, 6, 0, Stride()).outcomes() for one in (Stretched(), Still()))
    refused = hexmj.draw_starts(6, 0)[:, 0] > 0
    assert refused.any() and not refused.all()
    assert np.array_equal(found.refused, refused)
    for name in ("fall", "slip", "margin", "path_distance", "work"):
        assert np.isnan(found[name].values[refused]).all()
        assert np.array_equal(found[name].values[~refused], still[name].values[~refused], equal_nan=True)
    none = TaskWalks(Stretched(), task, 1, 1, Stride()).outcomes() if refused[0] else None
    assert none is None or none.refused.dtype == bool


@pytest.mark.parametrize("error", [SimulationError, OutOfReach, StillThrown])
def test_walks_that_fail_are_left_out(error: type[Exception]) -> None:
    def walked(which: np.ndarray) -> np.ndarray:
        if 2 in which:
            raise error("refused")
        return which

    assert np.concatenate([part for _, part in by_halves(np.arange(5), walked)]).tolist() == [0, 1, 3, 4]


def test_a_push_is_recovered_when_velocities_are_usual_again() -> None:
    rng, steps = np.random.default_rng(0), 200
    motion = rng.normal(size=(steps + 1, 3, 3)) * np.array([0.0, 1e-3, 1e-5])
    motion[..., 0] = 0.03
    pushed = motion.copy()
    pushed[50:80, 0, 1] += 1.0
    pushed[50:, 1, 1] += 1.0
    pushed[90:, 2] = np.nan
    time = recovery_times(pushed.cumsum(axis=0), motion.cumsum(axis=0), np.full(3, 49), 0.1)
    assert_allclose(time, [3.0, np.inf, np.nan])


def test_shipped_tasks_can_be_read_and_have_a_description() -> None:
    assert {*TASKS} <= {*known_tasks()}
    for name in known_tasks():
        assert load_task(name).name == name and load_task(name).about.endswith(".")


def test_a_file_is_a_task(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        'duration = 50.0\nfeedback = true\n[command]\nforward = 0.2\nturn = 0.001\n[terrain]\nground = "gap"\n'
        "ground_length = 3.0\n[conditions]\nvp = 60.0\n"
        '[[events]]\nkind = "push"\ntime = 3.0\nimpulse = 2.0\n[[events]]\nkind = "leg_lost"\nleg = 1\n'
    )
    expected = Task(
        "mine", Command(0.2, turn=0.001), Terrain.gap(3.0), (Push(3.0, 2.0), LegLost(1)), 50.0, feedback=True,
        conditions=Conditions(vp=60.0),
    )  # fmt: skip
    assert load_task(file) == expected
    assert expected.all_conditions == Conditions(vp=60.0, ground="gap", ground_length=3.0)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("speed = 1", "speed"),
        ("duration = -1.0", "duration"),
        ('duration = "long"', "duration"),
        ("command = 1.5", "command"),
        ("[command]\nforward = 2.0", "forward"),
        ("[command]\nsideward = 0.1", "sideward"),
        ('[terrain]\nground = "sand"', "ground"),
        ("[terrain]\nground_height = 2.0", "ground_height"),
        ("[conditions]\nvp = -1.0", "vp"),
        ('[[events]]\nkind = "rain"', "kind"),
        ('[[events]]\nkind = "push"\nimpulse = 1e9', "impulse"),
        ('[[events]]\nkind = "leg_lost"\nleg = 7', "leg"),
        ('[[events]]\nkind = "halt"\n[[events]]\nkind = "leg_stopped"', "events"),
        ('starts = "steady"\n[[events]]\nkind = "halt"', "starts"),
    ],
)
def test_bad_files_are_errors(text: str, name: str, tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=name):
        load_task(file)


def test_unknown_tasks_and_bad_numbers_are_errors() -> None:
    with pytest.raises(InputError, match="nothing"):
        load_task("nothing")
    with pytest.raises(InputError, match="n_starts"):
        run_task("slow", LDVS, n_starts=0)
    with pytest.raises(InputError, match="controllers"):
        run_task("slow", {})


def test_constructors_of_terrain_set_conditions() -> None:
    made = {
        Terrain.step(2.0): {"ground": "step", "ground_height": 2.0},
        Terrain.stairs(2.0, 15.0): {"ground": "stairs", "ground_height": 2.0, "ground_length": 15.0},
        Terrain.gap(4.0, 60.0): {"ground": "gap", "ground_length": 4.0, "ground_at": 60.0},
        Terrain.rough(2.5, 3): {"ground": "rough", "ground_height": 2.5, "ground_seed": 3},
        Terrain.slope(0.2, -0.1): {"pitch": 0.2, "roll": -0.1},
        Terrain.soft(8.0): {"softness": 8.0},
        Terrain.slippery(0.3): {"friction": 0.3},
    }
    for terrain, changed in made.items():
        assert terrain.on(Conditions(vp=50.0)) == replace(Conditions(vp=50.0), **changed)


@pytest.mark.parametrize(("leg", "time"), [(0, 0.0), (4, 10.0)])
def test_a_lost_leg_does_not_stand_and_the_others_do_not_change(leg: int, time: float) -> None:
    starts, lame = hexmj.draw_starts(3, 1), WithoutLeg(LDVS, leg, time=time)
    planned, whole = hexmj.walk(starts, lame, 0.3, 30.0), hexmj.walk(starts, LDVS, 0.3, 30.0)
    lost = planned.time > time + 1e-9
    assert not planned.stance[lost][..., leg].any()
    assert np.array_equal(planned.stance[~lost], whole.stance[~lost])
    others = np.arange(6) != leg
    assert np.array_equal(planned.stance[..., others], whole.stance[..., others])
    assert np.array_equal(planned.x, whole.x)
    walked = hexmj.physical_walk(starts, lame, 0.3, 30.0)
    raised = walked.measured.time > time + 2 * lame.held / RISE
    assert not walked.measured.stance[raised][..., leg].any()


@pytest.mark.slow
def test_controllers_with_a_lost_leg_or_poor_senses_keep_the_protocol() -> None:
    check_controller(WithoutLeg(LDVS, 2, time=5.0))
    check_controller(WithoutLeg(SensoryFeedback(LDVS), 2))
    check_controller(PoorSenses(SensoryFeedback(hexmj.HWS), 0.1, 1.6))
    with pytest.raises(InputError):
        hexmj.flss(PoorSenses(LDVS, 0.1), [0.5], n_starts=2)


@pytest.mark.slow
def test_senses_without_errors_change_nothing_and_errors_belong_to_their_start() -> None:
    starts, sensing = hexmj.draw_starts(3, 2), SensoryFeedback(LDVS)
    plain, perfect = (hexmj.physical_walk(starts, one, 0.5, 40.0).qpos for one in (sensing, PoorSenses(sensing)))
    assert np.array_equal(plain, perfect, equal_nan=True)
    noisy = PoorSenses(sensing, noise=0.1)
    together, alone = (hexmj.physical_walk(some, noisy, 0.5, 40.0).qpos for some in (starts, starts[2:]))
    assert np.array_equal(together[:, 2:], alone, equal_nan=True)
    late = hexmj.physical_walk(starts, PoorSenses(sensing, delay=2.0), 0.5, 40.0).qpos
    assert not np.array_equal(late, plain, equal_nan=True) and not np.array_equal(together, plain, equal_nan=True)


@pytest.fixture(scope="module")
def league() -> xr.Dataset:
    tasks = [
        Task("curve", Command(0.2, turn=0.003), duration=40.0),
        Task("push", 0.3, events=(Push(10.0),), duration=40.0),
    ]
    return run_task(tasks, {"ldvs": LDVS, "still": Still(), "far": Stretched()}, n_starts=3, seed=0)


def test_tables_and_figures_show_every_controller_and_task(league: xr.Dataset) -> None:
    text = league_markdown(league)
    assert "nan" not in text and "### push" in text
    figure = matrix_figure(league)
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == league.controller.values.tolist()
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == league.task.values.tolist()
    assert cost_figure(league).axes


def test_frequencies_are_counts_of_starts(league: xr.Dataset) -> None:
    cell = league.sel(task="curve", controller="ldvs")
    assert cell.fell == np.isfinite(cell.fall).mean() and cell.lost == np.isfinite(cell.planned_loss).mean()
    assert league.n_refused.sel(controller="far", task="push") == (hexmj.draw_starts(3, 0)[:, 0] > 0).sum()


def test_finished_cells_are_kept(tmp_path: Path) -> None:
    study = TaskStudy([Task("t", 0.3, duration=10.0)], {"ldvs": LDVS}, 2)
    first = hexmj.sweep.run_study(study, tmp_path)
    files = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert hexmj.sweep.run_study(study, tmp_path, threads=1).identical(first)
    assert len(files) == 1 and files == {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}


OWN = """
from dataclasses import dataclass
from hexmj.controllers.baselines.metronomes import Metronome

@dataclass(frozen=True)
class One(Metronome):
    name: str = "one"

@dataclass(frozen=True)
class Ldvs(One):
    name: str = "ldvs"
"""


def test_controllers_of_files_have_short_and_distinct_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(OWN)
    expected = {"own.py:One": "one", "own.py:Ldvs": "own.py:Ldvs", "ldvs": "ldvs"}
    assert entrants([*expected]) == {short: load_controller(name) for name, short in expected.items()}


@pytest.mark.slow
def test_the_commands_write_their_files(tmp_path: Path, run: Any) -> None:
    code, text, _ = run("task", "turn", "--starts", 2, "--dt", 0.5, "--out", tmp_path / "task")
    assert code == 0 and "ldvs" in text
    assert {path.name for path in (tmp_path / "task").iterdir()} == {"tasks.nc", "manifest.json", "walks"}
    words = ["league", "--quick", "--tasks", "slow", "push", "--starts", 2, "--dt", 0.5, "--out", tmp_path / "league"]
    assert run(*words)[0] == 0
    names = {"league.nc", "league.md", "league.png", "cost.png", "manifest.json", "walks"}
    assert {path.name for path in (tmp_path / "league").iterdir()} == names
    code, text, _ = run("league", "--list")
    assert code == 0 and "slalom" in text and "graham" in text
