"""Physical FLSS and steps per second for other solver settings, by which the insect's settings were chosen.

    python -m benchmarks.solver_settings [FOLDER] [STARTS]

Each row changes one setting, and LDVS walks the same starts from rest at V = 0.5. The last column says whether the FLSS
lies within the 95 % interval of the finest physics, a quarter of the shipped time step. Among those, we chose by slip
and speed. Rows are timed in turn, three times, and the median counts. The result is FOLDER/solver_settings.json.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import chdir
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from benchmarks.table import print_table
from hexmj import LDVS, Conditions, SimulationError, Stride, draw_starts
from hexmj.bodies.mjcf import compile_body
from hexmj.files import write_text
from hexmj.io import json_text
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.settle import Settled, settle
from hexmj.stats import wilson_interval

VELOCITY, DURATION = 0.5, 40.0
FINEST = "time step / 4"
ROUNDS = 3

OPTIONS: dict[str, dict[str, Any]] = {
    "as shipped": {},
    "dense Jacobian": {"jacobian": mujoco.mjtJacobian.mjJAC_DENSE},
    "islands": {"disableflags": 0},
    "pyramidal cone": {"cone": mujoco.mjtCone.mjCONE_PYRAMIDAL},
    **{f"impratio {ratio}": {"impratio": ratio} for ratio in (1, 2, 5, 10, 30, 100)},
    **{f"at most {n} iterations": {"iterations": n} for n in (3, 5, 8)},
    "tolerance 1": {"tolerance": 1.0},
    "solver CG": {"solver": mujoco.mjtSolver.mjSOL_CG},
    "Euler": {"integrator": mujoco.mjtIntegrator.mjINT_EULER},
}
"""Setting -> values of `mjOption` that differ from the shipped ones."""


def variants(starts: np.ndarray) -> Iterator[tuple[str, Settled]]:
    """Yield the name of a setting and the starts at rest."""
    settled = settle(starts)
    for name, options in OPTIONS.items():
        yield name, with_model(settled, **options)
    yield "pairs searched for", with_model(settled, searched=True)
    coarse = with_model(settled, timestep=settled.conditions.seconds(settled.stride))
    yield "time step x 2", replace(coarse, conditions=_Coarse())
    yield "time step / 2", settle(starts, Conditions(longest_substep=0.3125))
    yield FINEST, settle(starts, Conditions(longest_substep=0.15625))


@dataclass(frozen=True)
class _Coarse(Conditions):
    """One physics step for each step of the plan, 1.25 ms, longer than `Conditions` allows."""

    def substeps(self, stride: Stride) -> int:
        return 1


def with_model(settled: Settled, searched: bool = False, **options: Any) -> Settled:
    """Return the same starts with other values in `mjOption`, or with contact pairs that MuJoCo searches for."""
    conditions = settled.conditions
    body, model = conditions.body, compile_body(conditions, settled.compiled.model.opt.timestep, looks=False).model
    if searched:
        spec = mujoco.MjSpec.from_file(str(body.mjcf))
        spec.compiler.discardvisual = True
        for pair in list(spec.pairs):
            geom = spec.geom(pair.geomname2)
            geom.conaffinity, geom.condim, geom.friction = 1, pair.condim, pair.friction[[0, 2, 3]]
            geom.solref, geom.solimp = pair.solref, pair.solimp
            spec.delete(pair)
        ground, like = spec.geom(body.ground), spec.geom(body.trunk[0])
        ground.contype, ground.solref, ground.solimp, ground.friction = 1, like.solref, like.solimp, like.friction
        spec.option.timestep = model.opt.timestep
        model = spec.compile()
    for name, value in options.items():
        setattr(model.opt, name, value)
    return replace(settled, compiled=replace(settled.compiled, model=model))


def measure(settled: Settled) -> dict[str, float]:
    """Return FLSS with its interval, thousand physics steps/s, mean slip [mm/s] and mean relative speed."""
    begin = perf_counter()
    outcomes = physical_outcomes(settled, LDVS, VELOCITY, DURATION)
    seconds = perf_counter() - begin
    fell = np.isfinite(outcomes.fall)
    low, high = wilson_interval(int(fell.sum()), len(fell))
    walked = np.minimum(outcomes.fall, DURATION) / settled.stride.dt * settled.conditions.substeps(settled.stride)
    return {
        "flss": float(fell.mean()),
        "low": low,
        "high": high,
        "steps_per_s": float(walked.sum() / seconds / 1e3),
        "walks_per_s": len(fell) / seconds,
        "slip": float(outcomes.slip.mean()),
        "speed": float(np.nanmean(outcomes.speed)),
    }


def table(starts: np.ndarray) -> dict[str, dict[str, float] | None]:
    """Measure each setting; None where the simulation diverges."""
    results: dict[str, dict[str, float] | None] = {}
    settings, rates = dict(variants(starts)), defaultdict(list)
    physical_outcomes(settings["as shipped"], LDVS, VELOCITY, 2.0)
    for _ in range(ROUNDS):
        for name, settled in settings.items():
            try:
                results[name] = row = measure(settled)
                rates[name].append((row["steps_per_s"], row["walks_per_s"]))
            except SimulationError:
                results[name] = None
    for name, row in results.items():
        if row:
            row["steps_per_s"], row["walks_per_s"] = np.median(rates[name], axis=0).tolist()
    return results


def rows(results: dict[str, dict[str, float] | None]) -> list[list[str]]:
    """Return the rows of the table as texts."""
    finest = results[FINEST]
    assert finest
    lines = []
    for name, row in results.items():
        if row is None:
            lines.append([name, "diverges", "", "", "", "", "no"])
            continue
        qualifies = finest["low"] <= row["flss"] <= finest["high"]
        flss = f"{row['flss']:.3f} ({row['low']:.2f}-{row['high']:.2f})"
        figures = [f"{row[key]:.{digits}f}" for key, digits in (("slip", 1), ("speed", 3), ("steps_per_s", 0))]
        lines.append([name, flss, *figures, f"{row['walks_per_s']:.0f}", "yes" if qualifies else "no"])
    return lines


def main(folder: str = "results/bench", starts: str = "400") -> None:
    """Measure, print and write the table."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    with chdir(folder):  # MuJoCo writes its log there
        results = table(draw_starts(int(starts), 0))
    columns = ["setting", "physical FLSS", "slip [mm/s]", "speed", "1000 steps/s", "walks/s", "FLSS within"]
    print_table(columns, rows(results))
    text = json_text(results)
    write_text(Path(folder) / "solver_settings.json", text)


if __name__ == "__main__":
    main(*sys.argv[1:])
