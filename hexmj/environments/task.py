"""The task: episodes, actions, observations and rewards, which all environments share.

The insect should walk straight ahead at a commanded velocity. An episode begins at a random start in S, settled as for
a physical walk. One step of an environment is one step of the plan, with its substeps. The controller plans every step,
and its plan is observed with both kinds of actions. Actions are targets of all joints, held for the step ('joints'), or
offsets to the tips that the controller plans ('tips'). With zero offsets, the insect walks as in
`measures.physical.physical_walk`, bit for bit.

Observations are float64 and clipped to their bounds (`observation_bounds`):

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
"""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.jitted import jitted
from hexmj.legs import LEGS
from hexmj.timing import Stride, steps_within
from hexmj.validate import choice, number, short

Actions = Literal["joints", "tips"]
"""Kinds of actions: 'joints' are targets of the joints, 'tips' are offsets to the planned tips."""

ROUNDING = 1e-6
"""Tolerance of an action's bounds, so that bounds rounded to single precision are allowed."""

BEYOND_RANGE = 0.5
"""Angle by which observed joint angles may exceed the joints' ranges, because MuJoCo's limits are soft [rad]."""

FASTEST_TURN = 200.0
"""Bound of the observed velocity of a joint, and of the angular velocity of the root about an axis [rad/s]."""

FASTEST = 20.0
"""Bound of the observed velocity of the root, as the height of free fall that reaches it [standing heights]."""


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
    def steps(self) -> int:
        """Largest number of steps of an episode."""
        return int(steps_within(self.duration, self.stride))

    @property
    def substeps(self) -> int:
        """Number of physics steps in one step of the environment."""
        return self.conditions.substeps(self.stride)

    @property
    def command(self) -> float:
        """Commanded velocity [mm/s]."""
        return self.velocity * self.conditions.vp


def observation_bounds(compiled: CompiledBody, task: Task) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the smallest and largest values of each observation, two arrays of its shape, by name."""
    lengths, ranges = compiled.body.lengths, compiled.model.actuator_ctrlrange[compiled.columns.ctrl]
    far, tall = -lengths.no_foot_margin, compiled.body.standing_height
    fastest = np.sqrt(2.0 * compiled.weight / compiled.body.mass * FASTEST * tall)
    size, legs = compiled.joints, len(LEGS)
    bounds: dict[str, Any] = {
        "joint_angles": (size, ranges[:, 0] - BEYOND_RANGE, ranges[:, 1] + BEYOND_RANGE),
        "joint_velocities": (size, -FASTEST_TURN, FASTEST_TURN),
        "orientation": (4, -1.0, 1.0),
        "velocity": (3, -fastest, fastest),
        "angular_velocity": (3, -FASTEST_TURN, FASTEST_TURN),
        "clearance": (1, -lengths.shortest_leg, FASTEST * tall),
        "tips": ((legs, 3), -far, far),
        "contact": (legs, 0.0, 1.0),
        "margin": (1, -far, far),
        "command": (1, 0.0, lengths.fastest_swing),
        "planned_stance": (legs, 0.0, 1.0),
        "planned_tips": ((legs, 3), -far, far),
    }
    if task.actions == "tips":
        bounds["out_of_reach"] = (legs, 0.0, float(task.substeps))
    return {name: (np.full(shape, low), np.full(shape, high)) for name, (shape, low, high) in bounds.items()}


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


def checked_actions(
    actions: Any, shape: tuple[int, ...] | None, low: np.ndarray | float = -1.0, high: np.ndarray | float = 1.0
) -> np.ndarray:
    """Return actions as an array of floats, after a check of its shape and bounds with the tolerance `ROUNDING`.

    Raises:
        InputError: the shape of the actions is wrong, or a number is out of its bounds.
    """
    actions = np.asarray(actions, dtype=float)
    if actions.shape != shape or not _within(actions, low, high):
        raise InputError(f"action = {short(actions)}; expected the shape {shape} and values within the action space")
    return actions


@jitted
def _within(actions: Any, low: Any, high: Any) -> bool:
    return ((actions >= low - ROUNDING) & (actions <= high + ROUNDING)).all()


def draw_start(rng: np.random.Generator, task: Task) -> np.ndarray:
    """Draw the next start of one insect, (1, leg) [mm]. Equal seeds give the same sequence as `draw_starts`."""
    return rng.uniform(task.stride.pep0, task.stride.aep0, (1, 6))
