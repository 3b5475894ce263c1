"""The task: episodes, actions, observations and rewards, which all environments share.

The insect should walk straight ahead at a commanded velocity. An episode begins at a random start in S, settled as for
a physical walk. One step of an environment is one step of the plan, with its substeps. The controller plans every step,
and its plan is observed with both kinds of actions. Actions are targets of all joints, held for the step ('joints'), or
offsets to the tips that the controller plans ('tips'); they are clipped to their bounds. With zero offsets, the insect
walks as in `measures.physical.physical_walk`, bit for bit.

Observations are float64, without bounds:

- joint_angles, joint_velocities: (leg * joint,) [rad], [rad/s], in the order of `ctrl`
- orientation: unit quaternion of the root, (w, x, y, z); the commanded direction is the world's x
- velocity: velocity of the root, (3,) [mm/s]: along its heading, to the left of it, and up
- angular_velocity: angular velocity of the root, in the root frame, (3,) [rad/s]
- clearance: height of the trunk's lowest point, (1,) [mm]
- tips: tips of the simulated legs in the root frame, (leg, axis) [mm]
- contact: (leg,) 1 for feet that the ground carried at the beginning of the last physics step, or less than
  `Conditions.contact_gap` before it
- margin: stability margin, (1,) [mm], of the feet in contact and the insect's own centre of mass; if no foot
  is in contact, `Lengths.no_foot_margin`, which is farther than any foot reaches
- command: commanded velocity, (1,) [mm/s]
- planned_stance: (leg,) 1 for legs that the plan puts in stance
- planned_tips: planned tips in the root frame, without offsets, (leg, axis) [mm]
- out_of_reach, with 'tips' only: (leg,) number of substeps of the last step in which the leg kept its joint angles,
  because its planned tip plus the offset was out of reach

The reward of a step is max(0, 1 - |v - c| / c) max(0, u), with the velocity v along the world's x after the step, the
command c and the upward component u of the body's vertical axis; it is 0 if the insect falls. A fall terminates an
episode: the trunk touches the ground. The end of the duration truncates it, and so does a foot that reaches the end of
a step, gap or hurdle.

Targets, observations and rewards are computed in compiled loops, because a dozen calls of NumPy take as long as the
physics of one insect. A test compares them with the same formulas in plain NumPy (`tests/plain_observations.py`).
"""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.jitted import jitted
from hexmj.legs import LEGS
from hexmj.stability import margins
from hexmj.timing import Stride, steps_within
from hexmj.validate import choice, number

Actions = Literal["joints", "tips"]
"""Kinds of actions: 'joints' are targets of the joints, 'tips' are offsets to the planned tips."""


@dataclass(frozen=True)
class Task:
    """The settings of episodes.

    Raises:
        InputError: a field is out of its range.
    """

    velocity: float = 0.3
    """Commanded V_r, 0 < V < 1, as a fraction of V_p."""
    actions: Actions = "joints"
    """Kind of actions: 'joints' or 'tips'."""
    controller: Controller = LDVS
    """Controller that plans the walk."""
    conditions: Conditions = field(default_factory=Conditions)
    """Conditions of the physical walk, such as V_p, body and ground."""
    stride: Stride = field(default_factory=Stride)
    """Step range and time step of the plan; one time step is one step of the environment."""
    duration: float = 200.0
    """Largest duration of an episode, which ends earlier if the insect falls [time units]."""

    def __post_init__(self) -> None:
        choice("actions", self.actions, ("joints", "tips"))
        if not 0 < number("velocity", self.velocity) < 1:
            raise InputError(f"velocity = {self.velocity}; expected a fraction of V_p, 0 < V < 1")
        check_controller_type(self.controller)
        check_ground(self.conditions)
        steps_within(self.duration, self.stride)

    @property
    def substeps(self) -> int:
        """Number of physics steps in one step of the environment."""
        return self.conditions.substeps(self.stride)

    @property
    def command(self) -> float:
        """Commanded velocity [mm/s]."""
        return self.velocity * self.conditions.vp


def observation_shapes(compiled: CompiledBody, task: Task) -> dict[str, tuple[int, ...]]:
    """Return the shape of each observation by name, in the order of `write_observations`."""
    joints, legs = (compiled.joints,), (len(LEGS),)
    shapes = {"joint_angles": joints, "joint_velocities": joints, "orientation": (4,), "velocity": (3,)}
    shapes |= {"angular_velocity": (3,), "clearance": (1,), "tips": (*legs, 3), "contact": legs, "margin": (1,)}
    shapes |= {"command": (1,), "planned_stance": legs, "planned_tips": (*legs, 3)}
    return shapes | ({"out_of_reach": legs} if task.actions == "tips" else {})


def action_bounds(compiled: CompiledBody, task: Task) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the smallest, the default and the largest action, (number,) each.

    They are joint targets, (leg * joint,) [rad], by default the home posture, or tip offsets forward, left and up,
    (leg * axis,) [mm], by default 0.
    """
    if task.actions == "joints":
        low, high = compiled.model.actuator_ctrlrange[compiled.columns.ctrl].T
        return low, compiled.home[compiled.columns.qpos], high
    most = np.full(3 * len(LEGS), compiled.body.lengths.largest_tip_offset)
    return -most, np.zeros(len(most)), most


def draw_start(rng: np.random.Generator, task: Task) -> np.ndarray:
    """Draw the next start of one insect, (1, leg) [mm]. Equal seeds give the same sequence as `draw_starts`."""
    return rng.uniform(task.stride.pep0, task.stride.aep0, (1, 6))


@jitted
def next_targets(actions: Any, ids: Any, scale: Any, ahead: Any, planned: Any, offset: bool) -> Any:
    """Return the joint targets [rad] or tip targets [mm] of n insects in the next step, (n, substep, number).

    Args:
        actions: actions of all insects, (insect, number).
        ids: indices of the insects that walk, (n,).
        scale: joint targets or tip offsets of the action 0, their changes per unit of a negative and of a positive
            action, and their smallest and largest values, to which they are clipped; each (number,).
        ahead: planned tips of all insects, (insect, step, substep, leg, axis), stance, (insect, step, leg), and the
            index of the next step, (insect,), which this function increments.
        planned: `Walkers.planned`, which this function updates.
        offset: whether the actions are offsets to the planned tips.
    """
    (default, below, above, low, high), (tips_ahead, stance_ahead, following) = scale, ahead
    stance, tips, missed = planned
    targets = np.empty((len(ids), tips_ahead.shape[2], actions.shape[1]))
    for i, n in enumerate(ids):
        path = tips_ahead[n, following[n]]
        for leg in range(6):
            stance[n, leg], missed[n, leg] = stance_ahead[n, following[n], leg], 0.0
            for axis in range(3):
                tips[n, leg, axis] = path[-1, leg, axis]
        for j in range(actions.shape[1]):
            value = default[j] + actions[n, j] * (above[j] if actions[n, j] > 0 else below[j])
            value = min(max(value, low[j]), high[j])
            for sub in range(len(targets[i])):
                targets[i, sub, j] = path[sub, j // 3, j % 3] + value if offset else value
        following[n] += 1
    return targets


@jitted
def write_observations(state: Any, standing: Any, planned: Any, trunk: Any, layout: Any, flat: Any) -> None:
    """Write the observations of n insects into `flat`, (n, number), in the order of `observation_shapes`.

    Args:
        state: positions, velocities, rotations from the root frames to the world and sensors, see `Walkers.state`.
        standing: whether each foot stands on the ground, (n, leg).
        planned: `Walkers.planned` of the insects.
        trunk: corners of the trunk in the root frame, (corner, axis), and their radii, (corner,) [mm].
        layout: number of joints, first sensor columns of feet and of the centre of mass, commanded velocity [mm/s],
            and the margin [mm] that is observed if no foot is in contact.
        flat: array to write.
    """
    (qpos, qvel, rotation, sensors), (stance, tips, missed), (corners, radii) = state, planned, trunk
    joints, foot, centre, command, no_foot = layout
    around, margin = np.empty((1, 6, 2)), np.empty(1)
    for n in range(len(flat)):
        q, v, turn, s, seen = qpos[n], qvel[n], rotation[n], sensors[n], flat[n]
        for j in range(joints):
            seen[j], seen[joints + j] = q[ROOT_QPOS + j], v[ROOT_QVEL + j]
        at = 2 * joints
        for k in range(4):
            seen[at + k] = q[3 + k]
        angle = np.arctan2(turn[1, 0], turn[0, 0])
        cosine, sine = np.cos(angle), np.sin(angle)
        seen[at + 4], seen[at + 5], seen[at + 6] = cosine * v[0] + sine * v[1], cosine * v[1] - sine * v[0], v[2]
        for k in range(3):
            seen[at + 7 + k] = v[3 + k]
        seen[at + 10] = np.inf
        for c in range(len(corners)):
            x, y, z = corners[c]
            up = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
            seen[at + 10] = min(seen[at + 10], q[2] + up - radii[c])
        at += 11
        for leg in range(6):
            for k in range(3):
                seen[at + 3 * leg + k] = 0.0
                for axis in range(3):
                    seen[at + 3 * leg + k] += (s[foot + 3 * leg + axis] - q[axis]) * turn[axis, k]
            for axis in range(2):
                around[0, leg, axis] = s[foot + 3 * leg + axis] - s[centre + axis]
            seen[at + 18 + leg], seen[at + 26 + leg] = standing[n, leg], stance[n, leg]
            for k in range(3):
                seen[at + 32 + 3 * leg + k] = tips[n, leg, k]
            if len(seen) > at + 50:
                seen[at + 50 + leg] = missed[n, leg]
        margins(around, standing[n : n + 1], margin)
        seen[at + 24], seen[at + 25] = max(margin[0], no_foot), command


@jitted
def end_step(ids: Any, shown: Any, state: Any, trunk: Any, command: float, time: Any, result: Any) -> bool:
    """Compute the rewards of insects that took a step, and which of their episodes it ended.

    Args:
        ids: indices of the insects that took the step, (n,).
        shown: their sensor values at the beginning of each substep, (n, substep, column).
        state: state of all insects after the step, see `Walkers.state`.
        trunk: first sensor column of the trunk's contacts, and the column after the last.
        command: commanded velocity [mm/s].
        time: steps taken in each episode, (insect,), which this function increments, and the steps of an episode.
        result: `walkers.Acted` of zeros, into which this function writes.

    Returns:
        Whether any episode has ended.
    """
    (_, qvel, rotation, sensors), (done, last), (reward, fell, over) = state, time, result
    ended = False
    for i, n in enumerate(ids):
        done[n] += 1
        for column in range(trunk[0], trunk[1]):
            fell[n] |= sensors[n, column] > 0
            for t in range(shown.shape[1]):
                fell[n] |= shown[i, t, column] > 0
        over[n] = done[n] == last and not fell[n]
        if not fell[n]:
            tracking = max(1.0 - abs(qvel[n, 0] - command) / command, 0.0)
            reward[n] = tracking * max(rotation[n, 2, 2], 0.0)
        ended |= fell[n] or over[n]
    return ended
