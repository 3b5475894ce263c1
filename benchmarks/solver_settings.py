"""Falls and slip for other physics steps, integrators and models of friction, and the parts of the slip.

    python -m benchmarks.solver_settings [STARTS] [PAGE]

LDVS walks the same starts from rest with each setting. The difference of the falls from the shipped setting has its
95 % interval over paired starts. PAGE, by default docs/concepts/physics.md, gets the table between its comments. The
parts of the displacement of standing feet are printed: `Parts` defines them.
"""

import copy
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import mujoco
import numpy as np

from benchmarks.table import print_table
from docs.results import END, table
from hexmj import LDVS, Conditions, draw_starts
from hexmj.bodies.kinematics import hinge_chains
from hexmj.files import write_text
from hexmj.jitted import jitted
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.outcomes import EffortSoFar
from hexmj.physics.rolling import rolled
from hexmj.physics.rollout import Chunk
from hexmj.physics.settle import Settled, settle
from hexmj.stats import paired_difference
from hexmj.timing import observation_duration

VELOCITIES, SEED = (0.5, 0.7), 0
STEPS = {1: "0.625 ms", 2: "0.313 ms", 4: "0.156 ms"}
SHIPPED = f"implicitfast, {STEPS[1]} (shipped)"
BEGIN = "<!-- table: numerics -->\n"
PARTS = ("displacement", "landing", "rolling", "creep")

DISCRETE = {"integrator": mujoco.mjtIntegrator.mjINT_DISCRETE}
FRICTION: dict[str, dict[str, Any]] = {
    **{f"impratio {ratio} (shipped: 3)": {"impratio": ratio} for ratio in (1, 10, 100)},
    "pyramidal cone": {"cone": mujoco.mjtCone.mjCONE_PYRAMIDAL},
    "3 noslip iterations": {"noslip_iterations": 3},
}
"""Model of friction -> values of `mjOption` that differ from the shipped ones."""


def variants(starts: np.ndarray) -> Iterator[tuple[str, Settled]]:
    """Yield the name of a setting and the starts at rest, which settle with the shipped integrator and friction."""
    for parts, name in STEPS.items():
        settled = settle(starts, Conditions(longest_substep=0.625 / parts))
        yield SHIPPED if parts == 1 else f"implicitfast, {name}", settled
        yield f"discrete, {name}", with_options(settled, DISCRETE)
    for name, options in FRICTION.items():
        yield name, with_options(settle(starts), options)


def with_options(settled: Settled, options: dict[str, Any]) -> Settled:
    """Return the same starts with other values in `mjOption`."""
    model = copy.copy(settled.compiled.model)
    for name, value in options.items():
        setattr(model.opt, name, value)
    return replace(settled, compiled=replace(settled.compiled, model=model))


class Parts(EffortSoFar):
    """Divides the horizontal displacement of the centres of standing feet; the lengths of all steps are added up.

    - rolling: displacement of a foot that rolls without sliding;
    - landing: the rest, which is the sliding of the lowest point, from touchdown until its speed first stops to fall;
    - creep: sliding after landing.
    """

    def __init__(self, settled: Settled) -> None:
        """Begin with zero lengths."""
        compiled = settled.compiled
        chains, size = hinge_chains(compiled.model, compiled.body), len(settled.starts)
        self._columns, self._timestep = compiled.columns, compiled.model.opt.timestep
        self._rolling = chains.axis, chains.zero, compiled.foot_radius
        self._lengths, self._along = np.zeros((2, size, len(PARTS)))
        self._contacts, self._brakes = np.zeros(size), np.full((size, 6), -1.0)

    def add(self, chunk: Chunk) -> None:
        """Add one chunk."""
        places = self._columns.foot.start, self._columns.touch.start
        seen, sums = (chunk.qpos, chunk.sensors, chunk.valid), (self._lengths, self._along, self._contacts)
        _divide(seen, chunk.ids, places, self._rolling, self._brakes, sums)

    def speeds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean speeds of `PARTS`, and of their components along the displacement, (part,) [mm/s]."""
        time = self._contacts[:, None] * self._timestep
        return (self._lengths / time).mean(axis=0), (self._along / time).mean(axis=0)


@jitted
def _divide(seen: Any, ids: Any, places: Any, rolling: Any, brakes: Any, sums: Any) -> None:
    """Add the parts of a chunk; `brakes` is the last sliding distance of a landing foot, -1 after its landing."""
    qpos, sensors, valid = seen
    lengths, along, contacts = sums
    foot, touch = places
    for i, start in enumerate(ids):
        for t in range(1, valid[i]):
            now, before = sensors[i, t], sensors[i, t - 1]
            for leg in range(6):
                if before[touch + leg] <= 0:
                    brakes[start, leg] = np.inf
                if before[touch + leg] <= 0 or now[touch + leg] <= 0:
                    continue
                f = foot + 3 * leg
                moved_x, moved_y = now[f] - before[f], now[f + 1] - before[f + 1]
                moved = np.hypot(moved_x, moved_y)
                rolled_x, rolled_y = rolled(qpos[i, t - 1], qpos[i, t], leg, rolling)
                slid_x, slid_y = moved_x - rolled_x, moved_y - rolled_y
                slid = np.hypot(slid_x, slid_y)
                brakes[start, leg] = slid if slid < brakes[start, leg] else -1.0
                part = 1 if brakes[start, leg] >= 0 else 3
                lengths[start, 0] += moved
                lengths[start, 2] += np.hypot(rolled_x, rolled_y)
                lengths[start, part] += slid
                if moved > 0:
                    along[start, 0] += moved
                    along[start, 2] += (rolled_x * moved_x + rolled_y * moved_y) / moved
                    along[start, part] += (slid_x * moved_x + slid_y * moved_y) / moved
                contacts[start] += 1.0


def main(starts: str = "400", page: str = "docs/concepts/physics.md") -> None:
    """Measure all settings, print the parts of the displacement and write the table into the page."""
    drawn, shipped, rows, parts = draw_starts(int(starts), SEED), {}, [], []
    for name, settled in variants(drawn):
        physical_outcomes(settled, LDVS, VELOCITIES[0], 1.0, effort=Parts(settled))  # compiles before the clock starts
        cells, begin = [], process_time()
        for velocity in VELOCITIES:
            divided = Parts(settled)
            (duration,) = observation_duration("walk", [velocity], settled.stride)
            outcomes = physical_outcomes(settled, LDVS, velocity, duration, effort=divided)
            fell = np.isfinite(outcomes.fall)
            difference, low, high = paired_difference(fell, shipped.setdefault(velocity, fell))
            paired = "" if name == SHIPPED else f"{difference:+.3f} ({low:+.3f} to {high:+.3f})"
            lengths, along = divided.speeds()
            slip = f"{outcomes.slip.mean():.2f} ({lengths[1]:.2f} + {lengths[3]:.2f})"
            cells += [f"{fell.mean():.3f}", paired, slip]
            parts.append([name, str(velocity), *(f"{a:.2f} ({b:.2f})" for a, b in zip(lengths, along, strict=True))])
        spent = process_time() - begin
        rows.append([name, *cells, f"{spent / shipped.setdefault('time', spent):.1f}"])
        print(*rows[-1], sep="  ", flush=True)
    print_table(["setting", "V", *(f"{part} (its component along the displacement) [mm/s]" for part in PARTS)], parts)
    columns = "|".join(f"falls, V = {v}|difference|slip (landing + creep)" for v in VELOCITIES)
    before, _, after = Path(page).read_text(encoding="utf-8").partition(BEGIN)
    found = table(f"setting|{columns}|time", rows) + f"\nLDVS, V_p = 80 mm/s, {starts} starts of seed {SEED}.\n"
    write_text(Path(page), before + BEGIN + found + END + after.partition(END)[2])


if __name__ == "__main__":
    main(*sys.argv[1:])
