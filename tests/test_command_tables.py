"""What commands print: nothing is shown as a number that is none, or that nobody can know."""

import numpy as np
import xarray as xr

from hexmj.cli.tables import interval


def test_what_nobody_reached_has_no_frequency() -> None:
    known = {"flss": 0.5, "flss_low": 0.25, "flss_high": 0.75}
    assert interval(xr.Dataset(known), "flss") == "0.500 (.25-.75)"
    assert interval(xr.Dataset(dict.fromkeys(known, np.nan)), "flss") == "-"


def test_pushes_have_no_rows_on_paper(tmp_path, run) -> None:
    words = ["--velocities", 0.5, "--starts", 2, "--disturbances", "push", "--impulses", 40, "--window", 45]
    code, text, _ = run("disturb", *words, "--strategies", "slow_down", "--out", tmp_path / "out")
    assert code == 0
    planned, walked = text.split("physical FLSS", 1)
    assert "undisturbed" in planned and "push" not in planned
    assert walked.count("push 40 ") == 4
