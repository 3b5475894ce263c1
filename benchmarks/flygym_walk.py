"""How fast one fly of flygym (NeuroMechFly) walks on one CPU thread, as a peer for hexmj's own speed.

Run by the interpreter of an environment that has flygym 1.2 (Python 3.11) or 2.x (Python 3.12), and not hexmj:

    ENV/bin/python benchmarks/flygym_walk.py [SECONDS] [--replay]

SECONDS is the simulated time that is measured [s]. The fly walks on flat ground with the tripod CPG, the recorded
steps and the leg adhesion that its flygym ships, without cameras or vision. Timed is the loop that a user writes: the
controller, the physics and, in flygym 1.2, the observation that every step computes. The CPG senses nothing, so with
--replay its commands are computed before the clock starts. WARM_UP seconds of walking come first, untimed. One JSON
line is printed: simulated_s and wall_s [s], steps_per_s in physics steps per wall second, real_time_factor =
simulated_s / wall_s, and distance_mm, how far the thorax moved forward, along x, in the measured time [mm].
"""

import argparse
import json
import math
import os
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np

TIMESTEP = 1e-4  # [s], the default of both versions
WARM_UP = 0.2  # [s] simulated: the fly lands and the CPG reaches its full amplitude


class Fly(NamedTuple):
    command: Callable[[], Any]  # one time step of the controller: joint targets and adhesion
    step: Callable[[Any], object]  # one time step of physics under such a command
    position: Callable[[], np.ndarray]  # thorax x, y, z [mm]


def fly_of_version_1() -> Fly:
    from flygym import Fly as Body
    from flygym import SingleFlySimulation
    from flygym.examples.locomotion import CPGNetwork, PreprogrammedSteps

    simulation = SingleFlySimulation(Body(enable_adhesion=True), cameras=[], timestep=TIMESTEP)
    simulation.reset()
    antiphase = np.add.outer(np.arange(6), np.arange(6)) % 2  # tripods: legs 0, 2, 4 against 1, 3, 5
    cpg = CPGNetwork(  # 12 Hz; the numbers that make_tripod_cpg_network of flygym 2 has by default
        timestep=TIMESTEP,
        intrinsic_freqs=np.full(6, 12.0),
        intrinsic_amps=np.ones(6),
        coupling_weights=10.0 * antiphase,
        phase_biases=np.pi * antiphase,
        convergence_coefs=np.full(6, 20.0),
    )
    steps = PreprogrammedSteps()

    def command() -> dict[str, np.ndarray]:
        cpg.step()
        phases = list(zip(steps.legs, cpg.curr_phases, cpg.curr_magnitudes, strict=True))
        joints = np.concatenate([steps.get_joint_angles(leg, phase, magnitude) for leg, phase, magnitude in phases])
        adhesion = np.array([steps.get_adhesion_onoff(leg, phase) for leg, phase, _ in phases], dtype=int)
        return {"joints": joints, "adhesion": adhesion}

    return Fly(command, simulation.step, lambda: simulation.fly.last_obs["pos"].copy())


def fly_of_version_2() -> Fly:
    from flygym import Simulation
    from flygym.compose import ActuatorType, FlatGroundWorld
    from flygym.utils.math import Rotation3D
    from flygym_demo.complex_terrain import (
        CPGController,
        LocomotionAction,
        PreprogrammedSteps,
        apply_locomotion_action,
        make_locomotion_fly,
        make_tripod_cpg_network,
    )

    body = make_locomotion_fly()
    world = FlatGroundWorld()
    world.add_fly(body, (0.0, 0.0, 0.8), Rotation3D("quat", (1.0, 0.0, 0.0, 0.0)))
    simulation = Simulation(world, timestep=TIMESTEP)
    order = body.get_actuated_jointdofs_order(ActuatorType.POSITION)
    controller = CPGController(make_tripod_cpg_network(TIMESTEP), PreprogrammedSteps(), order)
    thorax = next(i for i, segment in enumerate(body.get_bodysegs_order()) if segment.name == "c_thorax")

    def step(command: LocomotionAction) -> None:
        apply_locomotion_action(simulation, body.name, command)
        simulation.step()

    return Fly(controller.step, step, lambda: simulation.get_body_positions(body.name)[thorax].copy())


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure how fast flygym walks one fly.")
    parser.add_argument("seconds", nargs="?", type=float, default=1.0, help="simulated time [s] (default: %(default)s)")
    parser.add_argument("--replay", action="store_true", help="compute the commands before the clock starts")
    arguments = parser.parse_args()
    steps = round(arguments.seconds / TIMESTEP)
    os.environ["MUJOCO_GL"] = "disable"  # read when MuJoCo is imported: neither EGL nor a display is looked for
    release = version("flygym")
    fly = fly_of_version_1() if release.startswith("1.") else fly_of_version_2()
    for _ in range(round(WARM_UP / TIMESTEP)):
        fly.step(fly.command())

    commands = (fly.command() for _ in range(steps))
    if arguments.replay:
        commands = iter(list(commands))
    start = fly.position()
    begin = time.perf_counter()
    for command in commands:
        fly.step(command)
    wall = time.perf_counter() - begin
    distance = float((fly.position() - start)[0])
    if not (math.isfinite(distance) and distance > 0):
        raise RuntimeError(f"the fly should walk forward, and moved {distance} mm along x in {arguments.seconds} s")
    result = {
        "peer": f"flygym {release}" + (", commands replayed" if arguments.replay else ""),
        "mujoco": version("mujoco"),
        "timestep_s": TIMESTEP,
        "simulated_s": steps * TIMESTEP,
        "wall_s": wall,
        "steps_per_s": steps / wall,
        "real_time_factor": steps * TIMESTEP / wall,
        "distance_mm": distance,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
