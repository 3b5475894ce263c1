"""`python -m tests.soak.walks STARTS`: physical walks of random controllers, bodies and conditions, all accounted for.

Every start is stable, fallen or refused with a reason; the last line says how many, and how much memory was used.
Exit code 1 if one is anything else.
"""

import json
import os
import re
import sys
import time
from argparse import ArgumentParser
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, fields
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

import hexmj
from hexmj.body import Body
from hexmj.controllers.checked_plans import begin
from hexmj.controllers.cruse1998 import PRESETS, Cruse1998, Weights
from hexmj.controllers.protocol import Controller
from hexmj.controllers.reads_legs import ReadsLegs
from hexmj.measures.physical import outcomes_of_plan
from hexmj.physics.outcomes import NUMBERS, Outcomes
from hexmj.physics.pushes import Push
from hexmj.physics.settling import settle
from tests.other_bodies import renamed

STARTS = 50
"""Of one controller, body and conditions."""

ORDERS = ("printed", "undelayed", "sequential")


@dataclass
class Account:
    """What became of some starts."""

    counts: Counter[str] = field(default_factory=Counter)
    """'drawn', 'stable', 'fallen', 'refused', 'odd'."""
    reasons: Counter[str] = field(default_factory=Counter)
    """Sentence of a refusal, without its numbers -> starts."""
    odd: str = ""
    """What is wrong with the outcomes of a start, and with which settings."""
    process: int = 0
    megabytes: float = 0.0
    """Memory of that process afterwards."""


def tried(seed: int, n_starts: int = STARTS) -> Account:
    """Walk starts with what is drawn from a seed."""
    rng = np.random.default_rng(seed)
    controller, velocity, duration = _controller(rng), rng.uniform(0.05, 0.95), rng.uniform(5.0, 30.0)
    values, factor = _conditions(rng), float(rng.choice([0.0, 0.0, 0.9, 0.95, 1.05, 1.15]))
    account = Account(Counter(drawn=n_starts), process=os.getpid())
    try:
        conditions = hexmj.Conditions(body=_body(factor), **values) if factor else hexmj.Conditions(**values)
        settled = settle(hexmj.draw_starts(n_starts, seed), conditions, threads=1)
        impulse = rng.uniform(-80.0, 80.0, n_starts) * conditions.body.mass * conditions.vp
        push = Push(impulse, rng.uniform(0.0, duration, n_starts)) if rng.random() < 0.2 else None
        plan = begin(controller, settled.starts, velocity, settled.stride, None, 1)
        lost = hexmj.first_loss(settled.starts, controller, velocity, duration, threads=1)
        outcomes = outcomes_of_plan(settled, plan, duration, lost, push=push, threads=1)
    except (hexmj.InputError, hexmj.SimulationError) as error:
        account.counts["refused"] += n_starts
        account.reasons[re.sub(r"-?\d[\d.e+-]*", "*", str(error)).split(";")[0][:120]] += n_starts
    else:
        fell, odd = np.isfinite(outcomes.fall), _odd(outcomes, duration)
        account.counts.update(fallen=int((fell & ~odd).sum()), stable=int((~fell & ~odd).sum()), odd=int(odd.sum()))
        if odd.any():
            start = int(np.argmax(odd))
            told = {one.name: getattr(outcomes, one.name)[start] for one in fields(outcomes)}
            account.odd = f"seed {seed}, start {start}, V = {velocity:.3g}, {controller.name}, {values}: {told}"
    account.megabytes = _megabytes()
    return account


def _controller(rng: np.random.Generator) -> Controller:
    """The network with a published set or random weights, in any order, a third of the time reading the legs."""
    presets = list(PRESETS.values())
    vector = rng.normal(0.0, 8.0, 58)
    vector[10:14], vector[54:58] = rng.integers(0, 2, (2, 4))
    vector[24:44] *= rng.choice([0.02, 1.0], 20)
    weights = presets[rng.integers(len(presets))].weights if rng.random() < 0.4 else Weights.from_vector(vector)
    controller = Cruse1998(weights, ORDERS[rng.integers(3)])
    return ReadsLegs(controller) if rng.random() < 1 / 3 else controller


def _conditions(rng: np.random.Generator) -> dict[str, Any]:
    """Some of the conditions, within what they may be."""
    drawn = {
        "vp": float(np.exp(rng.uniform(np.log(30.0), np.log(400.0)))),
        "step_height": rng.uniform(5.0, 14.0),
        "standing_height": rng.uniform(6.0, 13.0),
        "lift_time": rng.uniform(5.0, 60.0),
        "landing_time": rng.uniform(5.0, 60.0),
        "load": rng.uniform(0.0, 3.0),
        "centre_of_mass": rng.uniform(-12.0, 8.0),
        "leg_mass": rng.uniform(0.05, 1.5),
        "friction": rng.uniform(0.1, 3.0),
        "grasp": rng.uniform(0.0, 20.0),
        "longest_substep": rng.uniform(0.2, 0.625),
        "contact_gap": rng.uniform(0.0, 30.0),
    }
    chosen = {name: value for name, value in drawn.items() if rng.random() < 0.3}
    if (ground := rng.choice(["flat", "flat", "step", "gap", "hurdle", "rough"])) != "flat":
        chosen |= {"ground": str(ground), "ground_height": rng.uniform(0.1, 8.0), "ground_at": rng.uniform(45.0, 60.0)}
    return chosen


@cache
def _body(factor: float) -> Body:
    """Other names, and legs so many times as long."""
    return renamed(Path(mkdtemp(prefix="hexmj-soak-")), factor)


def _odd(outcomes: Outcomes, duration: float) -> np.ndarray:
    """(start,) whether an outcome is none: a number that is not finite, or a time beyond the walk."""
    odd = np.zeros(len(outcomes.fall), dtype=bool)
    for name in NUMBERS:
        odd |= ~np.isfinite(getattr(outcomes, name))
    for when in (outcomes.planned_loss, outcomes.measured_loss, outcomes.fall):
        odd |= ~((when >= 0.0) & (when <= duration + 1e-9) | np.isposinf(when))
    return odd | (np.isfinite(outcomes.fall) != (outcomes.fall_part >= 0))


def _megabytes() -> float:
    """Memory that this process holds now; 0 where the system does not say."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return 0.0


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("starts", type=int, nargs="?", default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results/soak_walks.json"))
    told = parser.parse_args()
    counts, reasons, memory, began = Counter[str](), Counter[str](), defaultdict(list), time.monotonic()
    with ProcessPoolExecutor(told.processes, get_context("spawn")) as workers:
        seeds = range(told.seed, told.seed + max(1, told.starts // STARTS))
        for done, account in enumerate(workers.map(tried, seeds), 1):
            counts.update(account.counts)
            reasons.update(account.reasons)
            memory[account.process].append(account.megabytes)
            if account.odd:
                print(account.odd, flush=True)
            print(f"\r{done * STARTS} starts, {counts['fallen']} fallen", end="", file=sys.stderr, flush=True)
    accounted = counts["stable"] + counts["fallen"] + counts["refused"] == counts["drawn"]
    summary = {
        **counts,
        "reasons": dict(reasons.most_common()),
        "megabytes, first and last tenth": [
            [round(float(np.median(part))) for part in (used[: len(used) // 10 + 1], used[-(len(used) // 10 + 1) :])]
            for used in memory.values()
        ],
        "minutes": round((time.monotonic() - began) / 60, 1),
    }
    told.out.parent.mkdir(parents=True, exist_ok=True)
    told.out.write_text(json.dumps(summary, indent=2) + "\n")
    print(json.dumps(summary))
    sys.exit(not accounted)


if __name__ == "__main__":
    main()
