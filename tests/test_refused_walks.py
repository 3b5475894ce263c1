"""Walks of the league that are refused: no outcome, counted as missing, and nobody else's concern."""

from typing import TypedDict

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.conditions import Conditions
from hexmj.errors import OutOfReach, SimulationError, StillThrown
from hexmj.measures.tables import came, frequencies
from hexmj.studies.entrants import Entrant
from hexmj.studies.league import League, in_physics
from hexmj.studies.league_figure import league_figure, walks_figure
from hexmj.studies.standings import league_markdown
from hexmj.timing import Stride
from standing_still import Still, Stretched


class Walked(TypedDict):
    """How walks go."""

    seed: int
    conditions: Conditions
    stride: Stride


def test_a_walk_that_is_refused_is_no_outcome_and_stops_nobody_else() -> None:
    entrant, how = Entrant(Stretched()), Walked(seed=0, conditions=Conditions(), stride=Stride())
    found = in_physics.walks(entrant, entrant.controller, 0.5, 10.0, n_starts=6, **how)
    refused = hexmj.draw_starts(6, 0)[:, 0] > 0
    assert refused.any() and not refused.all()
    still = in_physics.walks(Entrant(Still()), Still(), 0.5, 10.0, n_starts=6, **how)
    for name, values in found.items():
        assert np.isnan(values.values[refused]).all()
        assert np.array_equal(values.values[~refused], still[name].values[~refused], equal_nan=True)
    assert np.array_equal(came(found.fall).isnull(), refused)
    told = frequencies("fell", came(found.fall).values[None], ("entrant",))
    assert told["fell_starts"][1] == (~refused).sum()


def test_where_every_walk_is_refused_nothing_is_known_and_the_league_goes_on() -> None:
    entrant = Entrant(Stretched())
    alone = League({"far": entrant}, (0.5,), 1, 1, 1, observation_time=10.0, accelerating=False, periods=12, seed=0)
    result = alone.result([cell.compute(threads=1) for cell in alone.cells()])
    assert np.isnan(result.physical).all() and (result.physical_starts == 0).all() and np.isnan(result.cost).all()
    assert "nan" not in league_markdown(result)
    league_figure(result)
    walks_figure(result)


@pytest.mark.parametrize("which", [{"velocities": (0.3, 0.9)}, {"tried_at": 0.9}, {"accelerating": True}])
def test_a_plan_that_cannot_walk_fast_is_refused_before_the_work(which) -> None:
    """With this time step it walks at V = 0.3; the league would end at it once all slower walks are done."""
    slow = {"velocities": (0.3,), "n_starts": 9, "n_physical": 2, "n_tried": 1, "accelerating": False}
    entrants = {"righetti": Entrant(hexmj.load_controller("righetti"))}
    assert League(entrants, **slow, stride=Stride(dt=0.4)).cells()
    with pytest.raises(hexmj.InputError, match=r"oscillators diverge at dt = 0.4 and V_r = 0.9"):
        League(entrants, **slow | which, stride=Stride(dt=0.4)).cells()


@pytest.mark.parametrize("error", [SimulationError, OutOfReach, StillThrown])
def test_a_refused_walk_is_missing_and_the_others_are_as_they_were(error: type[Exception]) -> None:
    def walked(which: np.ndarray, refused: tuple[int, ...] = ()) -> xr.Dataset:
        if np.isin(which, refused).any():
            raise error("refused")
        return xr.Dataset({"fall": ("start", np.sqrt(which), {"units": "mm"})})

    def found(*refused: int) -> xr.DataArray:
        return in_physics.unless_refused(lambda which: walked(which, refused), 4, {"fall": "mm"}).fall

    whole = found()
    assert found(2).identical(whole.where([True, True, False, True]))
    assert np.isnan(found(0, 1, 2, 3)).all()
    with pytest.raises(ZeroDivisionError):
        in_physics.unless_refused(lambda which: walked(which[: 1 // 0]), 4, {"fall": "mm"})


@pytest.mark.slow
def test_tables_say_of_how_many_walks_where_some_are_missing() -> None:
    one = League({"far": Entrant(Stretched())}, (0.5,), 6, 6, 1, observation_time=10.0, accelerating=False, periods=12, seed=0)
    result = one.result([cell.compute(threads=1) for cell in one.cells()])
    left = int((hexmj.draw_starts(6, 0)[:, 0] <= 0).sum())
    assert result.missing.item() == 6 - left and 0 < left < 6
    text = league_markdown(result)
    assert f") of {left} |" in text and f"far (walks missing: {6 - left}) |" in text


def test_conditions_in_which_no_start_comes_to_rest_are_an_error() -> None:
    entrant, how = Entrant(Still()), Walked(seed=0, conditions=Conditions(settling_time=3.0), stride=Stride())
    with pytest.raises(SimulationError, match="start 0 did not settle in 3 ms"):
        in_physics.walks(entrant, entrant.controller, 0.3, 5.0, n_starts=2, **how)
