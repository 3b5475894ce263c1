"""What the package computes, frozen to the last bit: `python tests/frozen_bits.py` compares, `--record` writes anew.

Every array of every sample is kept as a digest in ``frozen_bits.json``, with the processor and the versions that made
it: MuJoCo's results depend on the processor (AVX-512).  A commit that changes a number on purpose records anew and
says so.
"""

import hashlib
import json
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import hexmj

KEPT = Path(__file__).with_suffix(".json")
SEEDS = (0, 7)
Arrays = Mapping[str, Any]


def kinematic_flss(seed: int) -> Arrays:
    from hexmj.parameters import Acceleration, Network

    starts = hexmj.draw_starts(300, seed)
    out = {}
    for name in ("hws", "ldvs", "own", "own-0.1"):
        for order in ("printed", "undelayed", "sequential"):
            loss = hexmj.first_loss(starts, hexmj.PRESETS[name], 0.4, 210.0, network=Network(order=order))
            out[f"{name} {order}"] = loss
    out["accelerated"] = hexmj.first_loss(
        starts, hexmj.LDVS, 0.5, 6000.0, acceleration=Acceleration(rate=0.0005, start=0.1)
    )
    table = hexmj.flss(hexmj.LDVS, [0.1, 0.5], starts=2500, seed=seed, network=Network(geometry=hexmj.CENTRED))
    walked = hexmj.walk(starts[:9], hexmj.HWS, 0.3, 90.0)
    out |= {"range": hexmj.flss_over_range(hexmj.LDVS, 0.1, 0.5, starts=2000, seed=seed)[0]}
    return out | _table(table) | {"x": walked.x, "stance": walked.stance, "margin": hexmj.walk_margin(walked)}


def gaits(seed: int) -> Arrays:
    from hexmj.gaits import limit_gait
    from hexmj.parameters import Network

    return vars(limit_gait(hexmj.HWS, 0.6, starts=5, seed=seed, network=Network(dt=0.05), periods=30))


def compared(seed: int, feedback: bool = False) -> Arrays:
    body = hexmj.Body(feedback=feedback)
    models = {"ldvs": hexmj.LDVS, "uncoordinated": hexmj.UNCOORDINATED}
    return _table(hexmj.compare(models, [0.3, 0.6], starts=8, window=60.0, seed=seed, body=body))


def compared_with_feedback(seed: int) -> Arrays:
    return compared(seed, feedback=True)


def other_conditions(seed: int) -> Arrays:
    body = hexmj.Body(
        vp=200.0, friction=0.5, load=1.0, leg_mass=0.5, centre_of_mass=2.0, grasp=0.5, standing_height=11.0,
        step_height=9.0, lift_time=10.0, landing_time=15.0, contact_gap=5.0, longest_substep=0.3,
    )  # fmt: skip
    network = hexmj.Network(geometry=hexmj.CENTRED, dt=0.2)
    return _table(hexmj.compare(hexmj.HWS, [0.4], starts=6, window=60.0, seed=seed, body=body, network=network))


def disturbed(seed: int) -> Arrays:
    from hexmj.experiments.disturbed_walks import cases, disturb

    walked = cases(("halt", "leg", "push"), (40.0,), ("reorganise", "slow_down", "grasp"), True)
    with tempfile.TemporaryDirectory() as folder:
        return _table(disturb(hexmj.LDVS, Path(folder), walked, velocities=[0.6], starts=4, window=30.0, seed=seed))


def disturbed_with_feedback(seed: int) -> Arrays:
    from hexmj.experiments.disturbed_walks import cases, disturb

    walked, body = cases(("halt",), (), ("reorganise",), True), hexmj.Body(feedback=True)
    with tempfile.TemporaryDirectory() as folder:
        return _table(
            disturb(hexmj.LDVS, Path(folder), walked, velocities=[0.6], starts=3, window=30.0, seed=seed, body=body)
        )


def terrain(seed: int) -> Arrays:
    from hexmj.experiments.terrain import terrain

    with tempfile.TemporaryDirectory() as folder:
        return _table(
            terrain(hexmj.LDVS, Path(folder), velocities=[0.6], heights=[3.0], lengths=[5.0], starts=4, seed=seed)
        )


def mapped(seed: int) -> Arrays:
    from hexmj.experiments.stability_map import stability_map

    chosen = {"vp": [40.0, 160.0], "centre_of_mass": [-5.0, 0.0]}
    out = {}
    for over, values in chosen.items():
        with tempfile.TemporaryDirectory() as folder:
            data = stability_map(
                hexmj.LDVS, over, Path(folder), values=values, velocities=[0.5], starts=6, window=60.0, seed=seed
            )
        out |= {f"{over} {name}": values for name, values in _table(data).items()}
    return out


def converged(seed: int) -> Arrays:
    from hexmj.trust.static_limit import converge

    with tempfile.TemporaryDirectory() as folder:
        data = converge(hexmj.LDVS, Path(folder), vps=[200.0, 80.0], starts=6, window="start", seed=seed)
    return _table(data)


def searched(seed: int) -> Arrays:
    from hexmj.search.stages import search

    out: dict[str, Any] = {}
    for algorithm, form, body in (("evolution", "hws", None), ("cmaes", "mirrored", None), ("cmaes", "ldvs", "body")):
        problem = hexmj.Problem(form, 0.4, 0.5, window=30.0, body=hexmj.Body() if body else None)
        few = 4 if body else 60
        plan = hexmj.Plan(
            algorithm=algorithm, population=4, starts=few, budget=12, refine_starts=few, refine_budget=6,
            begin=hexmj.LDVS if body else None, seed=seed,
        )  # fmt: skip
        found = search(problem, plan)
        out |= {
            f"{algorithm} {form} {key}": value for key, value in {"vector": found.vector, "cost": found.cost}.items()
        }
        out |= {f"{algorithm} {form} {name}": found.history[name].values for name in ("candidate", "cost", "stage")}
    return out


def recorded(seed: int) -> Arrays:
    starts = hexmj.draw_starts(2, seed)
    walked = hexmj.physical_walk(starts, hexmj.LDVS, 0.5, 60.0)
    planned = hexmj.walk(starts, hexmj.LDVS, 0.5, 60.0)
    puppet = hexmj.record_plan(planned, walked.body, walked.network, start=1)
    both = {"walk": hexmj.record(walked, 1), "puppet": puppet}
    return {f"{name} {key}": values for name, one in both.items() for key, values in _table(one).items()}


def environment(seed: int) -> Arrays:
    from hexmj import environment

    out: dict[str, list[Any]] = {}
    for actions in ("tips", "joints"):
        walking = environment.load(0.5, actions=actions, duration=15.0, seed=seed)
        spec, rng = walking.action_spec(), np.random.default_rng(seed)
        step = walking.reset()
        for _ in range(200):
            near = 0.5 if actions == "tips" else 0.02
            action = near * rng.uniform(-1.0, 1.0, spec.shape)
            if actions == "joints":
                action = action + walking.physics.position()[7:]
            step = walking.step(np.clip(action, spec.minimum, spec.maximum))
            for name, value in step.observation.items():
                out.setdefault(f"{actions} {name}", []).append(value)
            out.setdefault(f"{actions} reward", []).append(np.nan if step.reward is None else step.reward)
            out.setdefault(f"{actions} qpos", []).append(walking.physics.position().copy())
    return out


def reproduced(seed: int) -> Arrays:
    from hexmj.paper.protocol import MEASUREMENTS, Protocol

    small = Protocol(samples=1, sample=50, velocities=(0.85,), gait_starts=3, gait_velocities=(0.8,), seed=seed)
    out = {}
    for name in ("hws", "ideal", "ldvs late", "hws regimes", "ldvs footfall"):
        out |= {f"{name} {key}": value for key, value in _table(MEASUREMENTS[name].at(0.85, small)).items()}
    return out


SAMPLES: tuple[Callable[[int], Arrays], ...] = (
    kinematic_flss, gaits, compared, compared_with_feedback, other_conditions, disturbed, disturbed_with_feedback,
    terrain, mapped, converged, searched, recorded, environment, reproduced,
)  # fmt: skip


def _table(data: Any) -> Arrays:
    return {str(name): values.values for name, values in data.variables.items()}


def digests(only: tuple[str, ...] = ()) -> Iterator[tuple[str, str]]:
    """Name of every array -> its digest; numbers only, as float64, and booleans."""
    for sample in SAMPLES:
        for seed in SEEDS if not only or sample.__name__ in only else ():
            for name, values in sample(seed).items():
                array = np.asarray(values)
                if array.dtype.kind in "biuf":
                    plain = np.ascontiguousarray(array, dtype=bool if array.dtype.kind == "b" else float)
                    whole = f"{plain.dtype} {plain.shape}".encode() + plain.tobytes()
                    yield f"{sample.__name__} {seed} {name}", hashlib.sha256(whole).hexdigest()[:16]


def machine() -> dict[str, str]:
    """What the bits depend on besides the code."""
    text = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else platform.processor()
    processor = next((line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name")), text)
    wide = str("avx512f" in text)
    return {"processor": processor, "avx512": wide} | {name: version(name) for name in ("mujoco", "numpy", "numba")}


def main(arguments: list[str]) -> int:
    record, only = "--record" in arguments, tuple(one for one in arguments if not one.startswith("--"))
    found = dict(digests(only))
    if record:
        kept = json.loads(KEPT.read_text())["digests"] if only else {}
        KEPT.write_text(json.dumps({"machine": machine(), "digests": kept | found}, indent=1) + "\n")
        return 0
    kept = json.loads(KEPT.read_text())
    if kept["machine"] != machine():
        print(f"recorded on another machine: {kept['machine']}, this is {machine()}")
    wanted = {name: one for name, one in kept["digests"].items() if not only or name.split()[0] in only}
    changed = [name for name in wanted if found.get(name, "missing") != wanted[name]]
    print("\n".join(changed), f"{len(wanted) - len(changed)} of {len(wanted)} arrays are the same bits", sep="\n")
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
