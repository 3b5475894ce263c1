"""What the package computes, frozen to the last bit: `python tests/frozen_bits.py` compares, `--record` writes anew.

Every array of every sample is kept as a digest in ``frozen_bits.json``, with the processor and the versions that made
it: MuJoCo's results depend on the processor (AVX-512), and those of a search by CMA-ES on the kernels that OpenBLAS has
for it: on an AMD processor 11 of its 24 arrays differ, and none with OPENBLAS_CORETYPE=SkylakeX.  A commit that
changes a number on purpose records anew and says so.
"""

import hashlib
import json
import platform
import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import hexmj

KEPT = Path(__file__).with_suffix(".json")
SEEDS = (0, 7)
Arrays = dict[str, Any]


def kinematic_flss(seed: int) -> Arrays:
    from hexmj import Acceleration, Cruse1998, Stride

    starts = hexmj.draw_starts(300, seed)
    out = {}
    for name in ("hws", "ldvs", "own", "own-0.1"):
        for order in ("printed", "undelayed", "sequential"):
            controller = Cruse1998(hexmj.PRESETS[name].weights, order)
            out[f"{name} {order}"] = hexmj.first_loss(starts, controller, 0.4, 210.0)
    out["accelerated"] = hexmj.first_loss(
        starts, hexmj.LDVS, 0.5, 6000.0, acceleration=Acceleration(rate=0.0005, start=0.1)
    )
    table = hexmj.flss(hexmj.LDVS, [0.1, 0.5], n_starts=2500, seed=seed, stride=Stride(geometry=hexmj.CENTRED))
    walked = hexmj.walk(starts[:9], hexmj.HWS, 0.3, 90.0)
    out |= {"range": hexmj.flss_over_range(hexmj.LDVS, 0.1, 0.5, n_starts=2000, seed=seed)[0]}
    return out | _table(table) | {"x": walked.x, "stance": walked.stance, "margin": hexmj.walk_margin(walked)}


def gaits(seed: int) -> Arrays:
    from hexmj.gaits import steady_state_gait

    return vars(steady_state_gait(hexmj.HWS, 0.6, n_starts=5, seed=seed, stride=hexmj.Stride(dt=0.05), periods=30))


def compared(seed: int, feedback: bool = False) -> Arrays:
    controllers = {"ldvs": hexmj.LDVS, "uncoordinated": hexmj.UNCOORDINATED}
    if feedback:
        controllers = {name: hexmj.SensoryFeedback(one) for name, one in controllers.items()}
    return _table(hexmj.compare(controllers, [0.3, 0.6], n_starts=8, observation_time=60.0, seed=seed))


def compared_with_feedback(seed: int) -> Arrays:
    return compared(seed, feedback=True)


def other_conditions(seed: int) -> Arrays:
    conditions = hexmj.Conditions(
        vp=200.0, friction=0.5, load=1.0, leg_mass=0.5, centre_of_mass=2.0, grasp=0.5, standing_height=11.0,
        step_height=9.0, lift_time=10.0, landing_time=15.0, contact_gap=5.0, longest_substep=0.3,
    )  # fmt: skip
    stride = hexmj.Stride(geometry=hexmj.CENTRED, dt=0.2)
    return _table(
        hexmj.compare(
            hexmj.HWS, [0.4], n_starts=6, observation_time=60.0, seed=seed, conditions=conditions, stride=stride
        )
    )


def disturbed(seed: int) -> Arrays:
    events: dict[str, Any] = {"halt": hexmj.Halt, "leg": hexmj.LegStopped, "push": partial(hexmj.Push, impulse=40.0)}
    tasks = [hexmj.Task("undisturbed", 0.6, events=(hexmj.Push(impulse=0.0),), duration=30.0)]
    for kind, event in events.items():
        for answer in ("none", "reorganise", "slow_down"):
            tasks.append(hexmj.Task(f"{kind} {answer}", 0.6, events=(event(answer=answer),), duration=30.0))
        adhesive = hexmj.Conditions(grasp=1.0)
        tasks.append(hexmj.Task(f"{kind} grasp", 0.6, events=(event(),), duration=30.0, conditions=adhesive))
    return _events(hexmj.run_task(tasks, hexmj.LDVS, n_starts=4, seed=seed))


def disturbed_with_feedback(seed: int) -> Arrays:
    events = hexmj.Push(impulse=0.0), hexmj.Halt(), hexmj.Halt(answer="reorganise")
    tasks = [hexmj.Task(str(i), 0.6, events=(event,), duration=30.0) for i, event in enumerate(events)]
    return _events(hexmj.run_task(tasks, hexmj.SensoryFeedback(hexmj.LDVS), n_starts=3, seed=seed))


def _events(result: Any) -> Arrays:
    """Times over (velocity, case, start), named as in version 0.5."""
    names = {"event": "time", "back": "back", "planned_loss": "planned_loss", "fall": "fall"}
    return {name: result[key].values.swapaxes(0, 1) for key, name in names.items()}


def terrain(seed: int) -> Arrays:
    step, gap, rough = (getattr(hexmj.Terrain, name) for name in ("step", "gap", "rough"))
    hurdle = hexmj.Terrain("hurdle", 3.0, 80.0, 10.0)
    grounds = [hexmj.Terrain(), step(3.0, 80.0), gap(5.0, 80.0), hurdle, rough(3.0, at=80.0)]
    tasks = [
        hexmj.Task(f"{i} {grasp}", 0.6, ground, duration=150.0 / 0.6, conditions=hexmj.Conditions(grasp=grasp))
        for i, ground in enumerate(grounds)
        for grasp in (0.0, 1.0)
    ]
    result = hexmj.run_task(tasks, hexmj.LDVS, n_starts=4, seed=seed)
    names = ("fall", "fall_part", "tilt", "speed")
    return {name: result[name].values.reshape(5, 2, 1, 4) for name in names}


def searched(seed: int) -> Arrays:
    from hexmj.search.forms import NetworkForm
    from hexmj.search.stages import search

    out: dict[str, Any] = {}
    ways: Any = (("evolution", "hws", None), ("cmaes", "mirrored", None), ("cmaes", "ldvs", "body"))
    for algorithm, form, body in ways:
        measure: Any = "physical" if body else "kinematic"
        problem = hexmj.Problem(NetworkForm(form), 0.4, 0.5, observation_time=30.0, measure=measure)
        few = 4 if body else 60
        effort = hexmj.Effort(
            algorithm=algorithm, population=4, starts=few, budget=12, refine_starts=few, refine_budget=6,
            begin=hexmj.LDVS if body else None, seed=seed,
        )  # fmt: skip
        found = search(problem, effort)
        out |= {
            f"{algorithm} {form} {key}": value for key, value in {"vector": found.vector, "cost": found.cost}.items()
        }
        out |= {f"{algorithm} {form} {name}": found.history[name].values for name in ("candidate", "cost", "stage")}
    return out


def recorded(seed: int) -> Arrays:
    starts = hexmj.draw_starts(2, seed)
    walked = hexmj.physical_walk(starts, hexmj.LDVS, 0.5, 60.0, forces=True)
    planned = hexmj.walk(starts, hexmj.LDVS, 0.5, 60.0)
    puppet = hexmj.record_plan(planned, walked.conditions, walked.stride, start=1)
    both = {"walk": hexmj.record(walked, 1), "puppet": puppet}
    return {f"{name} {key}": values for name, one in both.items() for key, values in _table(one).items()}


def environment(seed: int) -> Arrays:
    from hexmj.environments import dm

    out: dict[str, list[Any]] = {}
    for actions in ("tips", "joints"):
        walking = dm.load(0.5, actions=actions, duration=15.0, seed=seed)
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
    for name in ("hws", "ideal", "ldvs late", "hws regimes"):
        one = MEASUREMENTS[name]
        measured = one.function(0.85, seed=small.seed, **one.settings(0.85, small))
        out |= {f"{name} {key}": value for key, value in _table(measured).items()}
    return out


SAMPLES: tuple[Callable[[int], Arrays], ...] = (
    kinematic_flss, gaits, compared, compared_with_feedback, other_conditions, disturbed, disturbed_with_feedback,
    terrain, searched, recorded, environment, reproduced,
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
