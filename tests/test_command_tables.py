"""What commands print and draw: no number that is none or nobody can know, none of more starts than counted."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from hexmj import LDVS, load
from hexmj.cli.tables import difference, four_digits, interval
from hexmj.studies.disturbance import disturbed_figure
from hexmj.studies.stability_map import StabilityMap, map_figure, mechanisms_figure
from hexmj.sweep import run_study


def test_what_nobody_reached_has_no_frequency() -> None:
    known = {"flss": 0.5, "flss_low": 0.25, "flss_high": 0.75}
    assert interval(xr.Dataset(known), "flss") == "0.500 (.25-.75)"
    assert interval(xr.Dataset(dict.fromkeys(known, np.nan)), "flss") == "-"
    assert difference(xr.Dataset(dict.fromkeys(known, np.nan)), "flss") == "-"


def test_a_difference_has_its_signs() -> None:
    assert difference(xr.Dataset({"lost": -0.5, "lost_low": -0.79, "lost_high": 0.04}), "lost") == "-.50 (-.79 to +.04)"


@pytest.mark.parametrize(
    ("number", "shown"), [(0.25, "0.25"), (60.02666, "60.03"), (10127.3, "10127"), (9999.7, "10000")]
)
def test_a_number_of_four_digits_is_never_rounded_before_its_point(number: float, shown: str) -> None:
    assert four_digits(number) == shown


@pytest.mark.thorough
def test_pushes_have_no_rows_on_paper(tmp_path, run) -> None:
    words = ["--velocities", 0.5, "--starts", 2, "--disturbances", "push", "--impulses", 40, "--observation time", 45]
    code, text, _ = run("disturb", *words, "--strategies", "slow_down", "--out", tmp_path / "out")
    assert code == 0
    planned, walked = text.split("physical FLSS", 1)
    assert "undisturbed" in planned and "push" not in planned
    assert walked.count("push 40 ") == 4
    result = load(tmp_path / "out" / "disturb.nc")
    assert "of them" not in disturbed_figure(result).get_suptitle()
    result.physical_reached[:] = 1
    told = disturbed_figure(result).get_suptitle().replace("\n", " ")
    assert told.endswith("; frequencies of at least 1 of them; slow down to V = 0.1, then a = 0.002")
    del result.attrs["recovery"]
    assert disturbed_figure(result).get_suptitle().endswith("; frequencies of at least 1 of them")


@pytest.mark.slow
def test_a_map_tells_how_many_starts_stand_at_every_value() -> None:
    """Of twelve starts one falls at rest where the centre of mass lies 15 mm ahead."""
    study = StabilityMap(LDVS, "centre_of_mass", (0.0, 15.0), (0.3,), n_starts=12, observation_time=20.0)
    result = run_study(study, threads=1)
    for draw in (map_figure, mechanisms_figure):
        assert draw(result).get_suptitle().endswith("; 11 of them stand and reach nine of ten tips at every value")
        assert "of them" not in draw(run_study(replace(study, values=(0.0,)), threads=1)).get_suptitle()
