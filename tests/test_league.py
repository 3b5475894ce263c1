"""The league: who takes part, what is asked of them, and what it comes to."""

from dataclasses import dataclass, replace
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

import hexmj
from hexmj.cli.tables import tables_that_fit
from hexmj.conditions import Conditions
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.cruse1998.presets import network_toml
from hexmj.controllers.leg_lost import HELD, RAISED, LegLost
from hexmj.controllers.poor_senses import PoorSenses
from hexmj.controllers.reads_legs import ReadsLegs
from hexmj.controllers.rivals.evolved import Evolved
from hexmj.controllers.rivals.lifted import Lifted
from hexmj.controllers.rivals.metronomes import Metronome
from hexmj.controllers.rivals.phase_oscillators import PhaseOscillators
from hexmj.controllers.stepwise import Step, stepwise
from hexmj.errors import InputError, OutOfReach, SimulationError, StillThrown
from hexmj.intervals import paired_difference
from hexmj.measures.captions import rules
from hexmj.measures.kinematic import first_loss, flss, flss_over_range, walk
from hexmj.measures.physical import physical_walk
from hexmj.physics.drive import drive
from hexmj.physics.effort import EffortSoFar
from hexmj.physics.settling import settle
from hexmj.studies.league import physics
from hexmj.studies.league.entrant import Entrant
from hexmj.studies.league.entrants import EVERYONE, entrants
from hexmj.studies.league.figure import FEWER, NOTHING, league_figure, walks_figure
from hexmj.studies.league.frequencies import came, frequencies
from hexmj.studies.league.paper import losses
from hexmj.studies.league.ranks import ranks
from hexmj.studies.league.study import League
from hexmj.studies.league.table import by_rank, league_markdown, tables
from hexmj.studies.league.trials import DISTURBED, TRIALS, walking
from hexmj.studies.short_names import short_names
from hexmj.sweeps import run
from hexmj.sweeps.plain import plain
from hexmj.timing import Stride

SMALL = "--starts 5 --physical-starts 1 --trial-starts 1 --velocities 0.5 --window 10 --no-video --out here"
NAMES = ("wilson", "ldvs", "graham-ideal")


@dataclass(frozen=True)
class Still:
    """A controller of one's own that can neither be steered nor reads its legs: it stands."""

    name: str = "still"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """All feet recede to PEP_min and stay there."""
        x = starts

        def step(v):
            nonlocal x
            x = np.maximum(x - v[:, None] * stride.dt, stride.pep_min)
            return Step(x, np.ones(x.shape, dtype=bool))

        return stepwise(step, starts, velocity, stride, acceleration)


class Walked(TypedDict):
    """How walks go."""

    seed: int
    conditions: Conditions
    stride: Stride


@dataclass(frozen=True)
class Stretched(Still):
    """The same; where the first leg starts ahead of its origin, that leg is told to stand where none reaches."""

    name: str = "stretched"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """As `Still`, with a tip far beside its line."""
        plan = super().begin(starts, velocity, stride, acceleration, threads)
        y = np.tile(stride.geometry.y, (len(starts), 1))
        y[starts[:, 0] > 0] *= 3
        still = plan.step
        plan.step = lambda v: replace(still(v), y=y)
        return plan


@pytest.fixture(scope="module")
def league() -> League:
    takes_part = {**entrants(NAMES), "still": Entrant(Still())}
    return League(takes_part, (0.3, 0.6), 12, 2, 2, window=40.0, accelerating=False, periods=12, seed=0)


@pytest.fixture(scope="module")
def data(league: League, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], xr.Dataset]:
    found = run(league.cells(), tmp_path_factory.mktemp("league"))
    return dict(zip(league.named_cells(), found, strict=True))


@pytest.fixture(scope="module")
def result(league: League, data) -> xr.Dataset:
    return league.result([*data.values()])


def test_everyone_is_found_and_can_be_asked_everything() -> None:
    takes_part = entrants(EVERYONE)
    assert len(takes_part) == len(EVERYONE)
    named = League(takes_part).named_cells()
    for name, entrant in takes_part.items():
        asked = {what for one, what in named if one == name}
        assert "physics 0.5" in asked and "paper 0.5" in asked
        assert entrant.ideal != ({*TRIALS} <= asked)
    with pytest.raises(InputError, match="ideal start of ldvs"):
        entrants(("ldvs-ideal",))


@pytest.mark.slow
def test_frequencies_are_those_of_the_commands(league: League, result) -> None:
    table = flss(hexmj.LDVS, (0.3, 0.6), n_starts=12, window=40.0)
    assert np.array_equal(result.kinematic.sel(entrant="ldvs"), table.flss)
    assert np.array_equal(result.kinematic_low.sel(entrant="ldvs"), table.low)
    j_n, _ = flss_over_range(hexmj.LDVS, 0.1, 0.5, n_starts=12, window=40.0)
    assert result.range.sel(entrant="ldvs") == j_n
    falls = hexmj.physical_flss(hexmj.load_controller("wilson"), (0.3, 0.6), n_starts=2, window=40.0)
    assert np.array_equal(result.physical.sel(entrant="wilson"), falls.flss)


def test_differences_are_those_on_the_same_starts(result) -> None:
    assert result.attrs["reference"] == "ldvs"
    assert not result.kinematic_above.sel(entrant="ldvs").any()
    starts, v = hexmj.draw_starts(12, 0), 0.3
    lost, of_ldvs = (
        np.isfinite(first_loss(starts, one, v, 40.0)) for one in (hexmj.load_controller("wilson"), hexmj.LDVS)
    )
    one = result.sel(entrant="wilson", velocity=v)
    ends = [one[f"kinematic_above{end}"].item() for end in ("", "_low", "_high")]
    assert np.allclose(ends, paired_difference(lost, of_ldvs))


def test_what_cannot_be_asked_is_not_known(result) -> None:
    still, ideal = (result.sel(entrant=name) for name in ("still", "graham-ideal"))
    assert np.isnan(still.fell.sel(trial=["halt", "leg", "push", "reads", "noise", "late"])).all()
    assert np.isfinite(still.fell.sel(trial=["load", "lost 1"])).all()
    assert np.isnan(result.fell.sel(trial=["step", "rough"])).all()  # 12 mm of way
    assert np.isnan(ideal.fell).all() and np.isnan(ideal.range) and (ideal.kinematic_starts == 1).all()
    assert (ideal.best == 0).all()
    assert by_rank(result).entrant.values[-1] == "graham-ideal"


def test_a_walk_that_is_refused_is_no_outcome_and_stops_nobody_else() -> None:
    entrant, how = Entrant(Stretched()), Walked(seed=0, conditions=Conditions(), stride=Stride())
    found = physics.walks(entrant, entrant.controller, 0.5, 10.0, n_starts=6, **how)
    refused = hexmj.draw_starts(6, 0)[:, 0] > 0
    assert refused.any() and not refused.all()
    still = physics.walks(Entrant(Still()), Still(), 0.5, 10.0, n_starts=6, **how)
    for name, values in found.items():
        assert np.isnan(values.values[refused]).all()
        assert np.array_equal(values.values[~refused], still[name].values[~refused], equal_nan=True)
    assert np.array_equal(came(found.fall).isnull(), refused)
    told = frequencies("fell", came(found.fall).values[None], ("entrant",))
    assert told["fell_starts"][1] == (~refused).sum()


def test_where_every_walk_is_refused_nothing_is_known_and_the_league_goes_on() -> None:
    entrant = Entrant(Stretched())
    alone = League({"far": entrant}, (0.5,), 1, 1, 1, window=10.0, accelerating=False, periods=12, seed=0)
    result = alone.result([cell.compute(threads=1) for cell in alone.cells()])
    assert np.isnan(result.physical).all() and (result.physical_starts == 0).all() and np.isnan(result.cost).all()
    assert "nan" not in league_markdown(result)
    league_figure(result)
    walks_figure(result)


def test_tables_and_figure_show_every_entrant(result) -> None:
    text = league_markdown(result)
    for table in tables(result):
        assert {row[0] for row in table.rows} == {*NAMES, "still"}
        assert all(len(row) == len(table.head) for row in table.rows)
        assert f"### {table.title}" in text
    assert "nan" not in text
    for draw in (league_figure, walks_figure):
        names = [label.get_text() for label in draw(result).axes[0].get_yticklabels()]
        assert [name.partition(" ")[0] for name in names] == by_rank(result).entrant.values.tolist()


def marks(figure) -> list[list[str]]:
    """What is written in the cells of each panel."""
    return [[text.get_text() for text in axes.texts] for axes in figure.axes]


def test_figures_say_where_walks_are_missing_and_where_nothing_is_known(result) -> None:
    assert not result.missing.any()
    assert FEWER not in str(marks(league_figure(result))) + league_figure(result).get_supxlabel()
    trials, *_ = marks(walks_figure(result))
    few, most = result.fell_starts.values, result.fell_starts.max().item()
    assert trials.count(NOTHING) == np.isnan(result.fell).sum() > 0
    assert trials.count(FEWER) == ((few > 0) & (few < most)).sum()
    assert f"{NOTHING} not asked" in walks_figure(result).get_supxlabel()
    lost = result.missing.copy()
    lost.loc[{"entrant": "still", "velocity": 0.6}] = 1
    fewer = result.assign(missing=lost)
    figure = league_figure(fewer)
    assert [one.count(FEWER) for one in marks(figure)[:3]] == [0, 1, 1]
    assert "walks are missing that diverged or were out of reach (in all still 1)" in figure.get_supxlabel()
    assert FEWER in marks(walks_figure(fewer))[3]


def test_titles_and_panels_keep_clear_of_each_other(result) -> None:
    for draw in (league_figure, walks_figure):
        for shown in (result, result.isel(velocity=[0], entrant=[0])):
            figure = draw(shown)
            figure.draw_without_rendering()
            boxes = [axes.title.get_window_extent() for axes in figure.axes if axes.get_title()]
            assert len(boxes) == 4
            assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
            assert boxes[0].x0 >= 0 and boxes[-1].x1 <= figure.bbox.width


def test_a_set_that_is_not_read_as_printed_is_told_everywhere(league: League, data) -> None:
    """Whatever it did: here all of them did what ldvs does."""
    others = replace(league, entrants=entrants(("lasting", "ldvs", "walknet", "walknet-reacog")))
    result = others.result([data["ldvs", what] for _, what in others.named_cells()])
    assert hexmj.settings(result)["not_printed"] == {"reading lasting": ["lasting"]}
    assert "| lasting (reading lasting) |" in league_markdown(result)
    for which in ("league", "walks"):
        title = hexmj.plot(result, which).get_suptitle()
        assert "reading lasting: lasting; " in title and title.count("lasting") == 2


def test_sequential_sets_and_those_that_read_legs_are_told_too() -> None:
    slow = replace(hexmj.load_controller("lasting"), order="sequential")  # pyright: ignore[reportArgumentType]
    for one in (slow, ReadsLegs(slow)):
        assert rules(plain(one)) == "sequential order, reading lasting"
    for name in ("ldvs", "walknet", "graham"):
        assert rules(plain(hexmj.load_controller(name))) == ""


OWN = """
from dataclasses import dataclass
from hexmj.controllers.rivals.metronomes import Metronome

@dataclass(frozen=True)
class One(Metronome):
    name: str = "one"

@dataclass(frozen=True)
class Ldvs(One):
    name: str = "ldvs"

@dataclass(frozen=True)
class Long(One):
    name: str = "one that has a very long name"

@dataclass(frozen=True)
class Bar(One):
    name: str = "a|b"
"""


def test_controllers_of_files_have_short_names_and_all_different_ones(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("a/b", "c/b"):
        Path(folder).mkdir(parents=True)
        Path(folder, "own.py").write_text(OWN)
        Path(folder, "found.toml").write_text(network_toml(hexmj.LDVS))
    expected = {
        "a/b/own.py:One": "a/b/own.py:One",
        "c/b/own.py:One": "c/b/own.py:One",
        "a/b/own.py:Ldvs": "own.py:Ldvs",
        "a/b/own.py:Long": "own.py:Long",
        "c/b/own.py:Bar": "own.py:Bar",
        "a/b/found.toml": "found",
        "ldvs-without-3": "ldvs-without-3",
        "ldvs": "ldvs",
    }
    assert short_names({name: hexmj.load_controller(name) for name in expected}) == expected
    takes_part = entrants(("a/b/own.py:One", "a/b/own.py:One-ideal", "graham-ideal"))
    assert [*takes_part] == ["one", "one-ideal", "graham-ideal"]
    assert [one.ideal for one in takes_part.values()] == [False, True, True]


def test_tables_are_as_wide_as_the_screen_and_break_no_cell(monkeypatch) -> None:
    head, rows = ("controller", *map(str, range(9))), [("a" * 20, *("0.123 (.01-.99)",) * 9)]
    for columns in (60, 80, 400):
        monkeypatch.setenv("COLUMNS", str(columns))
        lines = StringIO()
        for table in tables_that_fit(head, rows):
            Console(file=lines, width=columns).print(table)
        text = lines.getvalue()
        assert text.count("0.123 (.01-.99)") == 9 and all(name in text.split() for name in head)
        assert text.count("a" * 20) == -(-9 // ((columns - 20) // 17))


@pytest.mark.parametrize("name", ["n_physical", "n_tried"])
def test_no_more_starts_walk_in_physics_than_on_paper(league: League, name: str) -> None:
    how: dict[str, Any] = {name: 13}
    with pytest.raises(InputError, match=f"{name} = 13; expected at most n_starts = 12"):
        replace(league, **how)


def test_fewer_starts_on_paper_are_all_that_walk_unless_more_are_asked_for() -> None:
    from hexmj.cli.main import options_of

    few = options_of(["league", "--starts", "20"]).study()
    assert (few.n_starts, few.n_physical, few.n_tried) == (20, 20, 20)
    assert options_of(["ablate", "--starts", "20"]).study().n_physical == 20
    for command in ("league", "ablate"):
        with pytest.raises(InputError, match="n_physical = 4; expected at most n_starts = 2"):
            options_of([command, "--starts", "2", "--physical-starts", "4"]).study()


@pytest.mark.slow
def test_cells_do_not_depend_on_threads_or_on_the_other_entrants(league: League, result) -> None:
    alone = replace(league, entrants={"wilson": league.entrants["wilson"]}, velocities=(0.6,))
    other = alone.result([cell.compute(threads=1) for cell in alone.cells()])
    result = result.sel(velocity=[0.6])
    for name in ("kinematic", "measured", "physical", "fell", "cost", "torque", "slip", "stable", "ipsilateral"):
        assert np.array_equal(other[name].sel(entrant="wilson"), result[name].sel(entrant="wilson"), equal_nan=True)


def test_ranks_are_given_only_where_intervals_separate() -> None:
    rng = np.random.default_rng(0)
    often, rarely, seldom = (rng.uniform(size=200) < p for p in (0.8, 0.2, 0.22))
    best, worst = ranks(np.array([often, rarely, seldom, np.full(200, np.nan)], dtype=float))
    assert best.tolist() == [3, 1, 1, 0]
    assert worst.tolist() == [3, 2, 2, 0]
    few = np.array([[0.0, 0.0], [1.0, 1.0]])  # two starts separate nobody
    assert [one.tolist() for one in ranks(few)] == [[1, 1], [2, 2]]


def test_a_difference_leaves_out_starts_that_are_not_known_and_takes_parts_of_walks() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.uniform(size=(2, 50)) < [[0.3], [0.5]]
    known = rng.uniform(size=50) < 0.8
    blanked = np.where(known, one, np.nan)
    assert np.array_equal(paired_difference(blanked, other), paired_difference(one[known], other[known]))
    assert np.isnan(paired_difference(np.full(50, np.nan), other)).all()
    middle, low, high = paired_difference(one / 2, other / 2)
    whole = paired_difference(one, other)
    assert np.isclose(middle, whole[0] / 2) and low < middle < high and high - low < whole[2] - whole[1]


def test_velocities_that_look_alike_are_not_the_same(league: League) -> None:
    near = replace(league, velocities=(0.3, 0.3000001))
    assert len(near.named_cells()) == len(league.named_cells())


def test_a_quick_look_obeys_what_else_is_asked() -> None:
    from hexmj.cli.main import options_of

    quick, asked = (options_of(["league", "--quick", *words]).study() for words in ([], ["--starts", "1000"]))
    assert (quick.n_starts, quick.n_physical, quick.velocities) == (200, 8, (0.1, 0.5, 0.9))
    assert asked == replace(quick, n_starts=1000)
    assert options_of(["league"]).study().velocities == League.velocities


@pytest.mark.parametrize("leg", [0, 4])
def test_a_lost_leg_is_in_neither_measure(leg: int) -> None:
    starts, lame = hexmj.draw_starts(3, 1), LegLost(hexmj.LDVS, leg)
    planned = walk(starts, lame, 0.3, 30.0)
    assert not planned.stance[..., leg].any()
    whole = walk(starts, hexmj.LDVS, 0.3, 30.0)
    others = np.arange(6) != leg
    assert np.array_equal(planned.stance[..., others], whole.stance[..., others])
    assert np.array_equal(planned.x, whole.x)
    walked = physical_walk(starts, lame, 0.3, 30.0)
    held = walked.measured.time > 2 * RAISED
    upright = np.isfinite(walked.height[held][..., leg])
    assert not walked.measured.stance[held][..., leg].any()
    assert (walked.height[held][..., leg][upright] > HELD / 3).mean() > 0.9


def test_lame_controllers_and_those_with_poor_senses_keep_the_protocol() -> None:
    check_controller(LegLost(hexmj.LDVS, 2))
    check_controller(LegLost(ReadsLegs(hexmj.LDVS), 2))
    check_controller(PoorSenses(ReadsLegs(hexmj.HWS), 0.1, 1.6))
    with pytest.raises(InputError, match="poor senses of ldvs"):
        hexmj.flss(PoorSenses(hexmj.LDVS, 0.1), [0.5], n_starts=2)
    with pytest.raises(InputError, match="noise = -1"):
        PoorSenses(hexmj.LDVS, -1.0)


def test_poor_senses_that_are_perfect_change_nothing_and_errors_are_a_starts_own() -> None:
    starts, reading = hexmj.draw_starts(3, 2), ReadsLegs(hexmj.LDVS)
    plain, perfect = (physical_walk(starts, one, 0.5, 40.0).qpos for one in (reading, PoorSenses(reading)))
    assert np.array_equal(plain, perfect, equal_nan=True)
    noisy = PoorSenses(reading, noise=0.1)
    together, alone = (physical_walk(some, noisy, 0.5, 40.0).qpos for some in (starts, starts[2:]))
    assert np.array_equal(together[:, 2:], alone, equal_nan=True)
    assert not np.array_equal(together, plain, equal_nan=True)
    late = physical_walk(starts, PoorSenses(reading, delay=2.0), 0.5, 40.0).qpos
    assert not np.array_equal(late, plain, equal_nan=True)


def test_work_and_torque_do_not_depend_on_chunks_and_are_those_of_the_strides() -> None:
    settled = settle(hexmj.draw_starts(2, 0), Conditions(), Stride())
    efforts = []
    for parts in (1, 3):
        plan = hexmj.LDVS.begin(settled.starts, np.full(2, 0.3), settled.stride)
        effort, chunks = EffortSoFar(settled), [*drive(settled, plan, 30.0)]
        for chunk in chunks:
            for part in np.array_split(np.arange(chunk.qpos.shape[1]), parts):
                shown = {name: getattr(chunk, name)[:, part] for name in ("qpos", "force")}
                valid = np.clip(chunk.valid - part[0], 0, len(part))
                effort.add(replace(chunk, **shown, valid=valid))
        efforts.append((effort.work, effort.torque))
    assert np.allclose(efforts[0][0], efforts[1][0], rtol=1e-12)
    assert np.array_equal(efforts[0][1], efforts[1][1])
    q = np.concatenate([chunk.qpos for chunk in chunks], axis=1)[..., settled.compiled.columns.qpos]
    force = np.concatenate([chunk.force for chunk in chunks], axis=1)
    h, damping = settled.compiled.model.opt.timestep, -settled.compiled.model.actuator_biasprm[:18, 2]
    turning = np.diff(q, axis=1) / h
    torque = force[:, 1:-1] - damping * np.diff(turning, axis=1)
    work = np.maximum(torque * turning[:, 1:], 0).sum(axis=(1, 2)) * h
    assert np.allclose(efforts[0][0], work, rtol=1e-12)


def test_trials_are_what_they_say() -> None:
    entrant, usual = Entrant(hexmj.LDVS), Conditions()
    walked = [name for name in TRIALS if name not in DISTURBED]
    found = {name: one for name in walked if (one := walking(name, entrant, usual, Stride()))}
    assert list(found) == walked
    assert found["load"].conditions.masses.load == 1.0
    assert found["step"].conditions.ground.ground_height == 3.0
    assert found["lost 2"].controller == LegLost(hexmj.LDVS, 1)
    assert found["late"].controller == PoorSenses(ReadsLegs(hexmj.LDVS), delay=1.6)


@pytest.mark.slow
def test_the_command_takes_a_controller_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    from hexmj.cli.main import options_of

    monkeypatch.chdir(tmp_path)
    example = Path(__file__).parents[1] / "examples" / "tripod.py"
    options_of(["league", "--controllers", f"{example}:Tripod", "ldvs", *SMALL.split()]).run()
    shown = capsys.readouterr().out
    assert "Standings" in shown and " tripod " in shown
    assert {"league.nc", "league.png", "league_walks.png", "league.md", "manifest.json"} <= {
        one.name for one in Path("here").iterdir()
    }


FAR = """
from dataclasses import dataclass
import numpy as np
from hexmj.controllers.stepwise import Step, stepwise

@dataclass(frozen=True)
class Far:
    name: str = "far"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        y, stands = np.tile(3 * np.array(stride.geometry.y), (len(starts), 1)), np.ones(starts.shape, dtype=bool)
        return stepwise(lambda v: Step(starts, stands, y=y), starts, velocity, stride, acceleration)
"""


@pytest.mark.slow
def test_who_cannot_be_filmed_costs_neither_tables_nor_manifest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    from hexmj.cli.main import options_of

    monkeypatch.chdir(tmp_path)
    Path("far.py").write_text(FAR)
    words = ["league", "--controllers", "graham-ideal", "far.py:Far", *SMALL.replace("--no-video", "").split()]
    options_of(words).run()
    shown = capsys.readouterr()
    assert "no video: " in shown.err and "Standings" in shown.out
    assert "below far on the same starts" in " ".join(shown.out.split()), "the first from random starts"
    written = {"league.nc", "league.png", "league_walks.png", "league.md", "manifest.json"}
    assert written == {one.name for one in Path("here").glob("*.*")}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda: League({"ldvs": hexmj.LDVS}), "entrants\\['ldvs'\\] = .* expected an Entrant"),  # pyright: ignore
        (lambda: League(entrants(("ldvs",)), periods=0), "periods = 0; expected a whole number of at least 12"),
        (lambda: Entrant(hexmj.load_controller("graham"), "no"), "ideal = 'no'; expected True or False"),  # pyright: ignore
        (lambda: Metronome("tripod"), "wave = 'tripod'; valid names: wilson, graham"),  # pyright: ignore
        (lambda: PhaseOscillators(coupling=np.nan), "cpg-tripod: coupling = nan; expected a finite number"),
        (lambda: Evolved(theta=np.inf), "evolved: theta = inf; expected a finite number"),
    ],
)
def test_entrants_and_rivals_that_make_no_sense_are_refused(given, said: str) -> None:
    with pytest.raises(InputError, match=said):
        given()


@pytest.mark.parametrize("state", [np.zeros((2, 6)), None, (np.zeros((2, 6)),)])
def test_a_rule_that_remembers_no_named_tuple_is_refused_as_it_begins(state) -> None:
    own = {"name": "rule", "at_start": lambda self, legs: state}
    rule: Any = dataclass(frozen=True)(type("Rule", (Lifted,), own))()
    with pytest.raises(
        InputError, match=r"at_start gave .* expected a named tuple of arrays whose first axis is the start, 2"
    ):
        hexmj.walk(hexmj.draw_starts(2, 0), rule, 0.5, 1.0)


def test_an_ideal_start_that_raises_is_one_sentence() -> None:
    @dataclass(frozen=True)
    class Gone(Still):
        def ideal_start(self, velocity, stride):
            raise ValueError("no gait at this velocity")

    with pytest.raises(InputError, match=r"still, ideal_start: ValueError in .*: no gait at this velocity"):
        Entrant(Gone(), ideal=True).starts(1, 0, 0.5, Stride())


def test_a_delay_that_is_no_step_is_refused_and_no_trial() -> None:
    late = PoorSenses(ReadsLegs(hexmj.LDVS), delay=0.04)
    with pytest.raises(InputError, match=r"delay = 0.04 with steps of 0.1 time units; expected at least one step"):
        late.begin(hexmj.draw_starts(1, 0), np.array([0.5]), Stride())
    assert walking("late", Entrant(hexmj.LDVS), Conditions.of(vp=2.0), Stride()) is None
    assert walking("noise", Entrant(hexmj.LDVS), Conditions.of(vp=2.0), Stride())


def test_tables_say_of_how_many_walks_where_some_are_missing() -> None:
    one = League({"far": Entrant(Stretched())}, (0.5,), 6, 6, 1, window=10.0, accelerating=False, periods=12, seed=0)
    result = one.result([cell.compute(threads=1) for cell in one.cells()])
    left = int((hexmj.draw_starts(6, 0)[:, 0] <= 0).sum())
    assert result.missing.item() == 6 - left and 0 < left < 6
    text = league_markdown(result)
    assert f") of {left} |" in text and f"far (walks missing: {6 - left}) |" in text


@pytest.mark.parametrize("option", ["--ground-height", "--ground-at", "--ground-length"])
def test_conditions_that_trials_bring_along_are_not_offered(option: str, capsys) -> None:
    from hexmj.cli.main import options_of

    with pytest.raises(SystemExit):
        options_of(["league", option, "5"])
    assert option in capsys.readouterr().err


@pytest.mark.parametrize("window", ["start", 40.0])
def test_a_window_of_accelerating_walks_begins_when_the_velocity_is_reached(window: str | float) -> None:
    eq11, entrant = hexmj.Acceleration(rate=0.01), Entrant(hexmj.load_controller("uncoordinated"))
    found = losses(entrant, 0.5, window, n_starts=20, seed=0, stride=Stride(), acceleration=eq11)
    lost = first_loss(hexmj.draw_starts(20, 0), hexmj.UNCOORDINATED, 0.5, 80.0, acceleration=eq11)
    assert np.array_equal(found.lost, np.isfinite(lost))


def test_conditions_in_which_no_start_comes_to_rest_are_an_error() -> None:
    entrant, how = Entrant(Still()), Walked(seed=0, conditions=Conditions.of(settling_time=3.0), stride=Stride())
    with pytest.raises(SimulationError, match="start 0 did not settle in 3 ms"):
        physics.walks(entrant, entrant.controller, 0.3, 5.0, n_starts=2, **how)


@pytest.mark.parametrize("error", [SimulationError, OutOfReach, StillThrown])
def test_a_refused_walk_is_missing_and_the_others_are_as_they_were(error: type[Exception]) -> None:
    def walked(which: np.ndarray, refused: tuple[int, ...] = ()) -> xr.Dataset:
        if np.isin(which, refused).any():
            raise error("refused")
        return xr.Dataset({"fall": ("start", np.sqrt(which), {"units": "mm"})})

    def found(*refused: int) -> xr.DataArray:
        return physics.unless_refused(lambda which: walked(which, refused), 4, {"fall": "mm"}).fall

    whole = found()
    assert found(2).identical(whole.where([True, True, False, True]))
    assert np.isnan(found(0, 1, 2, 3)).all()
    with pytest.raises(ZeroDivisionError):
        physics.unless_refused(lambda which: walked(which[: 1 // 0]), 4, {"fall": "mm"})
