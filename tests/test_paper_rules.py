"""The rules of the paper's claims, on made-up measurements."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from hexmj.paper.claims import Answer, Band, Claim, Rule, Seen, claims, fisher
from hexmj.paper.quantities import Gaits, Losses, Measured, main_peak
from hexmj.paper.reproduce import Row, summary, verdict


def losses(*rates: float, starts: int = 1000, velocities: tuple[float, ...] = (0.1, 0.2, 0.3)) -> xr.Dataset:
    """A measurement with these frequencies, the same under both observation times."""
    lost = np.arange(starts) < np.round(np.array(rates)[:, np.newaxis] * starts)
    return xr.Dataset(
        {"lost": (("observation_time", "velocity", "start"), np.stack([lost, lost]).astype(np.int8))},
        {"observation_time": ["walk", "start"], "velocity": list(velocities)},
    )


def gaits(phases: np.ndarray) -> xr.Dataset:
    """Accelerated gaits at V = 0.5 with the same phases, (start,), for every pair."""
    fine = np.ones((1, len(phases)), dtype=bool)
    pairs = ["1-2", "2-3", "4-5", "5-6", "1-4", "2-5", "3-6"]
    by_start = ("velocity", "start")
    return xr.Dataset(
        {
            "phase": ((*by_start, "pair"), np.repeat(phases[np.newaxis, :, np.newaxis], 7, axis=2)),
            "periodic": (by_start, fine), "stable": (by_start, fine), "lost": (by_start, ~fine),
        },
        {"velocity": [0.5], "pair": pairs},
    )  # fmt: skip


def answer_of(rule: Rule, data: dict[str, xr.Dataset], observation_time: str) -> Answer:
    """Return the answer of a rule that can be judged."""
    answer = rule.answer(Measured(data), observation_time)
    assert answer is not None
    return answer


def test_rules_agree_if_every_interval_reaches_the_band():
    measured = {"hws": losses(0.01, 0.2, 0.31), "ldvs": losses(0.02, 0.1, 0.5)}
    below = Band(Losses("hws"), (0.1, 0.3), most=0.3)
    answer = answer_of(below, measured, "walk")
    assert answer.agrees and answer.where == "V = 0.3" and answer.low < 0.3 < answer.value
    assert not answer_of(Band(Losses("hws"), (0.1, 0.3), most=0.25), measured, "walk").agrees
    assert not answer_of(Band(Losses("hws"), (0.1, 0.3), least=0.1), measured, "walk").agrees
    apart = answer_of(Band(Losses("ldvs", "hws"), (0.1, 0.3), most=0.0), measured, "walk")
    assert not apart.agrees and apart.value == pytest.approx(0.19) and apart.where == "V = 0.3"
    assert answer_of(Band(Losses("hws", "ldvs", 2.0), (0.1, 0.3), most=0.0), measured, "walk").agrees
    assert answer_of(Band(Losses("hws"), (0.1, 0.3), least=0.0, over="changes"), measured, "walk").agrees
    assert not answer_of(Band(Losses("hws"), (0.1, 0.3), most=0.0, over="changes"), measured, "walk").agrees


def test_a_range_whose_ends_are_not_met_is_not_judged():
    measured = {"hws": losses(0.01, 0.2, 0.3)}
    assert answer_of(Band(Losses("hws"), (0.1, 0.35), most=0.3), measured, "walk")
    assert Band(Losses("hws"), (0.1, 0.4), most=0.3).answer(Measured(measured), "walk") is None
    unknown = losses(0.01, 0.2, 0.3)
    unknown.lost[:] = -1
    assert Band(Losses("hws"), (0.1, 0.3), most=0.3).answer(Measured({"hws": unknown}), "walk") is None


def test_phases_are_judged_in_the_main_peak_and_the_others_counted():
    phases = np.array([0.66, 0.67, 0.67, 0.68, 0.2])
    assert main_peak(phases).tolist() == [True, True, True, True, False]
    assert main_peak(np.array([0.99, 0.01, 0.02, 0.5])).tolist() == [True, True, True, False]
    measured = {"hws gaits": gaits(phases)}
    answer = answer_of(Band(Gaits("hws", "ipsilateral phase"), (0.5, 0.5), 0.66, 0.68), measured, "")
    assert answer.agrees and answer.value == pytest.approx(0.67)
    assert not answer_of(Band(Gaits("hws", "ipsilateral phase"), (0.5, 0.5), 0.7, 0.8), measured, "").agrees
    outside = answer_of(
        Band(Gaits("hws", "part of starts outside the main peak of a pair"), (0.5, 0.5), 0.0, 0.0), measured, ""
    )
    assert outside.value == pytest.approx(0.2) and not outside.agrees


def test_phases_near_0_are_judged_on_the_circle():
    measured = {"hws gaits": gaits(np.array([0.98, 0.99, 0.01, 0.02]))}
    assert abs(answer_of(Band(Gaits("hws", "ipsilateral phase"), (0.5, 0.5), most=0.1), measured, "").value) < 1e-9
    measured["hws gaits"].phase[:, :, :4] = [0.98, 0.01, 0.02, 0.99]
    pairs = Gaits("hws", "largest - smallest phase, on the circle, of the ipsilateral pairs")
    spread = answer_of(Band(pairs, (0.5, 0.5), most=0.1), measured, "")
    assert spread.agrees and spread.value == pytest.approx(0.04)


def test_an_unstable_regime_need_not_be_periodic():
    measured = {"hws regimes": gaits(np.full(4, 0.5))}
    measured["hws regimes"].stable[:] = [[True, True, False, False]]
    measured["hws regimes"].periodic[:] = [[True, False, True, False]]
    measured["hws gaits"] = measured["hws regimes"]
    for how in ("without acceleration to an unstable", "with acceleration to an aperiodic"):
        fault = Gaits("hws", f"part of starts that come {how} limit regime")
        assert answer_of(Band(fault, (0.5, 0.5), most=0.5), measured, "").value == 0.5


def test_a_mean_over_velocities_is_judged_on_the_same_starts():
    measured = {"hws": losses(0.1, 0.1, 0.4), "ldvs": losses(0.2, 0.2, 0.1)}
    rule = Band(Losses("hws", "ldvs"), (0.1, 0.3), most=0.0, over="mean")
    answer = answer_of(rule, measured, "walk")
    assert answer.value == pytest.approx(0.1 / 3) and not answer.agrees and answer.where == "V = 0.1, mean to 0.3"
    assert not answer_of(replace(rule, over="each"), measured, "walk").agrees


def test_a_curve_is_compared_with_another_at_one_velocity():
    measured = {"hws accelerated": losses(0.01, 0.02, 0.05), "hws": losses(0.01, 0.9, 1.0)}
    answer = answer_of(Band(Losses("hws accelerated", "hws", at=0.1), (0.1, 0.3), -0.02, 0.02), measured, "walk")
    assert answer.value == pytest.approx(0.04) and answer.where == "V = 0.3" and not answer.agrees
    assert Band(Losses("hws", "hws", at=0.05), (0.1, 0.3)).answer(Measured(measured), "walk") is None


def test_rare_events_are_compared_with_the_papers_own_sample():
    """p of 3 of 3 against 0 of 3 is 2 / 20, of 1 of 100 against 0 of 100 it is 1, whichever comes first."""
    assert fisher(3, 3, 0, 3) == pytest.approx(0.1)
    assert fisher(1, 100, 0, 100) == fisher(0, 100, 1, 100) == 1.0
    assert fisher(0, 0, 0, 100) == 0.0
    rule = Seen(Losses("hws"), (0.1, 0.3), 0, 100)
    assert answer_of(rule, {"hws": losses(0.0, 0.05, 0.0, starts=100)}, "walk").agrees
    answer = answer_of(rule, {"hws": losses(0.0, 0.06, 0.0, starts=100)}, "walk")
    assert not answer.agrees and answer.where == "V = 0.2" and answer.value == pytest.approx(0.06)


def test_observation_times_are_judged_separately():
    lost = losses(0.1, 0.1, 0.1)
    lost.lost.loc[{"observation_time": "start"}] = 0
    claim = Claim("a", "5", "slow", "< 0.05", Band(Losses("hws"), (0.1, 0.3), most=0.05), why="why")
    row = Row(claim, claim.answers(Measured({"hws": lost})))
    assert {time: verdict(answer) for time, answer in row.answers.items()} == {"walk": "differs", "start": "agrees"}
    assert row.why == "why"


def test_calibrated_claims_are_counted_separately():
    measured, rule = Measured({"hws": losses(0.1, 0.1, 0.1)}), Band(Losses("hws"), (0.1, 0.3), most=0.2)
    rows = [replace(claims()[key], rule=rule) for key in ("hws-0.4", "hws-slow")]
    assert [(claim.kind, claim.calibrates) for claim in rows] == [
        ("calibrated", ("PEP_min", "observation time")),
        ("held out", ()),
    ]
    line = summary([Row(claim, claim.answers(measured)) for claim in rows])[0]
    assert line.endswith("observation time walk: held out 1 agrees; calibrated 1 agrees")
