"""How well a reading of the paper explains its numbers: claims judged, constants refined, ideal sets searched anew.

Constants are refined on claims from whose numbers they were inferred; the others were held out.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.controllers.cruse1998 import PRESETS
from hexmj.legs import CENTRED
from hexmj.paper.claims import CLAIMS, Claim
from hexmj.paper.measurements import losses
from hexmj.paper.protocol import MEASUREMENTS, Gaits, Losses, Protocol
from hexmj.paper.reproduce import measure
from hexmj.paper.rules import Answer, Band, Trend
from hexmj.paper.table import judge
from hexmj.search.forms import NetworkForm
from hexmj.search.problems import Problem
from hexmj.search.stages import Effort, search
from hexmj.timing import OBSERVATION_TIMES, Stride

if TYPE_CHECKING:
    import xarray as xr

SCORING = Protocol(
    samples=1,
    sample=300,
    velocities=(0.1, 0.25, 0.4, 0.45, 0.5, 0.6, 0.75, 0.85, 0.9),
    gait_starts=20,
    gait_velocities=(0.1, 0.25, 0.4, 0.7, 0.95),
    gait_stride=Stride(),
)
"""How much is simulated for a score: enough to tell readings apart, not to judge a claim."""

SCORED = ("hws", "ldvs")
"""Sets whose claims need no search, with 'uncoordinated' beside them."""

REFINED_BY = (
    "hws-phase-0.1", "hws-phase-0.4", "hws-phase-third", "hws-0.4", "ldvs-0.4", "ldvs-slow", "ldvs-below-hws",
)  # fmt: skip
"""Claims on which constants are refined: calibrated ones that need neither a search nor the gaits at every V."""

REFINING: dict[str, Any] = {"velocities": (0.1, 0.25, 0.4, 0.5), "gait_velocities": (0.1, 0.25, 0.4)}
"""What is simulated for these, of a protocol."""

ROUNDS: tuple[tuple[dict[str, Any], ...], ...] = (
    tuple({"aep0": a, "pep0": -a} for a in (9.0, 9.5, 10.5, 11.0)),
    tuple({"pep_min": one} for one in (-15.0, -18.0, -25.0)),
    ({"geometry": CENTRED},),
)
"""Constants of the stride that are tried one round after another, each beside the best so far."""

IDEAL_VELOCITIES = (0.1, 0.25, 0.4, 0.45, 0.75, 0.9)
"""At which ideal sets are searched for a score."""

IDEAL = Effort(algorithm="cmaes", population=12, domain=3.0, budget=480, refine_budget=0)
"""The search for one, on other starts than those of the score."""

NOT_JUDGED = -1


def judged(
    claims: Sequence[Claim],
    protocol: Protocol,
    known: "Mapping[str, xr.Dataset] | None" = None,
    threads: int | None = None,
) -> "xr.Dataset":
    """Claims judged under a protocol; measurements that are `known` need not be taken.

    Returns:
        Over claim and observation time: `agrees`, 1, 0 or -1 where a set was not searched; and `miss`, by how much the point that
        strains a band or a trend most lies outside.  A claim that no observation time concerns stands under both.
    """
    import xarray as xr

    names = {name for claim in claims for name in claim.rule.quantity.needs}
    measured = dict(known or {})
    measured |= {name: measure(name, protocol, threads=threads) for name in MEASUREMENTS if name in names - {*measured}}
    shape = len(claims), len(OBSERVATION_TIMES)
    agrees, miss = np.full(shape, NOT_JUDGED, dtype=np.int8), np.zeros(shape)
    for i, claim in enumerate(claims):
        answers = judge(claim, measured).answers
        for j, observation_time in enumerate(OBSERVATION_TIMES):
            if answer := answers.get(observation_time, answers.get("")):
                agrees[i, j], miss[i, j] = answer.agrees, _miss(claim, answer)
    coordinates = {"claim": [claim.key for claim in claims], "observation_time": list(OBSERVATION_TIMES)}
    return xr.Dataset(
        {"agrees": (("claim", "observation_time"), agrees), "miss": (("claim", "observation_time"), miss)}, coordinates
    )


def _miss(claim: Claim, answer: Answer) -> float:
    """How far an answer lies outside of its rule; 0 where the rule is a count's."""
    rule, value = claim.rule, answer.value
    if value != value:
        return 1.0
    if isinstance(rule, Band):
        return max(0.0, value - rule.most, rule.least - value)
    return max(0.0, -rule.sign * value) if isinstance(rule, Trend) else 0.0


def refined(protocol: Protocol, threads: int | None = None) -> Protocol:
    """The protocol with the constants whose misses on `REFINED_BY` are least, under the observation time that they fit best."""
    claims = [claim for claim in CLAIMS if claim.key in REFINED_BY]

    def miss(stride: Stride) -> float:
        tried = replace(with_stride(protocol, stride), **REFINING)
        return judged(claims, tried, threads=threads).miss.sum("claim").min().item()

    best, least = protocol.stride, miss(protocol.stride)
    for alternatives in ROUNDS:
        for one in [replace(best, **constants) for constants in alternatives]:
            if (now := miss(one)) < least:
                best, least = one, now
    return with_stride(protocol, best)


def with_stride(protocol: Protocol, stride: Stride) -> Protocol:
    """A protocol with another stride, its gaits with their own time step."""
    return replace(protocol, stride=stride, gait_stride=replace(stride, dt=protocol.gait_stride.dt))


def score(protocol: Protocol, threads: int | None = None) -> "xr.Dataset":
    """Claims on the printed sets judged, over constants (as inferred, refined), claim and observation time."""
    import xarray as xr

    better = refined(protocol, threads)
    first = score_as_is(protocol, threads)
    both = xr.concat([first, score_as_is(better, threads) if better != protocol else first], "constants")
    told = {name: ((), getattr(better.stride, name), {"units": "mm"}) for name in ("aep0", "pep0", "pep_min")}
    both = both.assign(told | {"centred": better.stride.geometry == CENTRED})
    return both.assign_coords(constants=["inferred", "refined"])


def score_as_is(protocol: Protocol, threads: int | None = None) -> "xr.Dataset":
    """Claims on the printed sets judged, over claim and observation time."""
    return judged([claim for claim in CLAIMS if _is_of(claim, SCORED)], protocol, threads=threads)


def score_of_ideals(protocol: Protocol, threads: int | None = None) -> "xr.Dataset":
    """Claims on the ideal sets judged, over claim and observation time, with `flss` of the sets that a search finds anew.

    The search is a short one, from the HWS, of each of `IDEAL_VELOCITIES` under the observation time 'walk'.
    """
    import xarray as xr

    protocol = replace(protocol, velocities=IDEAL_VELOCITIES)
    found = [_ideal_losses(velocity, protocol, threads) for velocity in IDEAL_VELOCITIES]
    lost = xr.concat(found, xr.Variable("velocity", list(IDEAL_VELOCITIES)))
    claims = [claim for claim in CLAIMS if _is_of(claim, (*SCORED, "ideal")) and not _is_of(claim, SCORED)]
    claims = [claim for claim in claims if "ideal late" not in claim.rule.quantity.needs]
    flss = lost.lost.sel(observation_time="walk").mean("start").rename(velocity="ideal_velocity")
    return judged(claims, protocol, {"ideal": lost}, threads).assign(flss=flss)


def _ideal_losses(velocity: float, protocol: Protocol, threads: int | None) -> "xr.Dataset":
    form = NetworkForm("hws", protocol.order, protocol.model_variant)
    problem = Problem(form, velocity, velocity, stride=protocol.stride)
    n_starts = protocol.samples * protocol.sample
    effort = replace(IDEAL, begin=PRESETS["hws"], starts=n_starts)
    best = form.controller(search(problem, effort, threads=threads).vector)
    how: Any = {"stride": protocol.stride, "acceleration": None, "late": False, "threads": threads}
    sets = tuple(best if observation_time == "walk" else None for observation_time in OBSERVATION_TIMES)
    return losses(velocity, sets, n_starts, protocol.seed, **how)


def _is_of(claim: Claim, presets: Collection[str]) -> bool:
    """Whether a claim is about the losses and gaits of some of these presets, or of no coordination, alone."""
    needs = [MEASUREMENTS[name] for name in claim.rule.quantity.needs]
    return bool(needs) and all(
        isinstance(one, Losses | Gaits) and one.preset in (*presets, "uncoordinated") for one in needs
    )
