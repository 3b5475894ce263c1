"""The task: what an episode, an action, an observation and a reward are, for every interface the same.

The insect should walk straight ahead at a commanded velocity. An episode begins at a random start in S, settled as for
a physical walk. One step of an environment is one step of the plan, with its substeps. The controller runs along, and
its plan is observed whatever the actions are. Actions are targets of all joints, held for the step ('joints'), or
offsets to the tips that the controller plans ('tips'). Without offsets, the insect walks as in
`measures.physical.physical_walk`, bit for bit.

Observations are float64 and clipped at their bounds (`observation_bounds`):

- joint_angles, joint_velocities: (leg * joint,) [rad], [rad/s], in the order of `ctrl`
- orientation: unit quaternion of the root, (w, x, y, z); the commanded direction is the world's x
- velocity: of the root, ahead, to the left and up, relative to its heading [mm/s]
- angular_velocity: of the root, in its own frame [rad/s]
- clearance: height of the trunk's lowest point, (1,) [mm]
- tips: in the root frame, (leg, axis) [mm]
- contact: (leg,) 1 where the ground carried the foot within the last `Conditions.contact_gap`, at the beginning of the
  last physics step
- margin: measured stability margin, (1,) [mm], of the feet in contact and the insect's own centre of mass;
  `Lengths.no_foot_margin`, which is out of any foot's reach, where no foot is in contact
- command: commanded velocity, (1,) [mm/s]
- planned_stance: (leg,) 1 where the plan lets the leg stand
- planned_tips: in the root frame, (leg, axis) [mm], without offsets
- out_of_reach, with 'tips' only: (leg,) substeps of the last step in which the leg kept its last angles, because its
  planned tip with the offset was out of reach

The reward of a step is max(0, 1 - |v - c| / c) max(0, u), with the velocity v along the world's x after the step, the
command c and the upward component u of the body's vertical; it is 0 on a fall. An episode is terminated by a fall: the
trunk touches the ground. It is truncated after its duration, or where a foot reaches the end of a step, gap or hurdle.

`observing` computes all of this.
"""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.timing import Stride, steps_within
from hexmj.validate import choice, number

Actions = Literal["joints", "tips"]
"""Kinds of actions: targets of the joints, or offsets to the tips."""

ROUNDING = 1e-6
"""Tolerance of an action's bounds: a bound that was rounded to single precision is allowed."""

BEYOND_RANGE = 0.5
"""Angle by which observed joints may exceed their ranges, whose limits are soft [rad]."""

FASTEST_TURN = 200.0
"""Greatest observed velocity of a joint, and of the root about an axis [rad/s]."""

FASTEST = 20.0
"""Greatest observed velocity of the root, as a height of free fall in standing heights h: sqrt(2 g h) for each."""


@dataclass(frozen=True)
class Task:
    """The settings of an episode.

    Raises:
        InputError: a value is out of its range.
    """

    velocity: float = 0.3
    """Commanded V_r, 0 < V < 1, as a fraction of V_p."""
    actions: Actions = "joints"
    """Kind of actions."""
    controller: Controller = LDVS
    """Controller that plans the walk."""
    conditions: Conditions = field(default_factory=Conditions)
    """Conditions of the walk."""
    stride: Stride = field(default_factory=Stride)
    """Stride of the plan; its time step is that of the environment."""
    duration: float = 200.0
    """Duration of an episode [time units]."""

    def __post_init__(self) -> None:
        choice("actions", self.actions, ("joints", "tips"))
        if not 0 < number("velocity", self.velocity) < 1:
            raise InputError(f"velocity = {self.velocity}; expected 0 < V < 1, a fraction of V_p")
        check_controller_type(self.controller)
        check_ground(self.conditions)
        steps_within(self.duration, self.stride)

    @property
    def steps(self) -> int:
        """Steps of an episode."""
        return int(steps_within(self.duration, self.stride))

    @property
    def substeps(self) -> int:
        """Physics steps in one step."""
        return self.conditions.substeps(self.stride)

    @property
    def command(self) -> float:
        """Commanded velocity [mm/s]."""
        return self.velocity * self.conditions.vp


def observation_bounds(compiled: CompiledBody, task: Task) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the least and the greatest value of every observation, in its shape, by name and in order."""
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


def action_names(compiled: CompiledBody, task: Task) -> tuple[str, ...]:
    """Return the names of an action's numbers."""
    if task.actions == "joints":
        return compiled.body.joints
    return tuple(f"{leg}_{axis}" for leg in LEGS for axis in ("forward", "left", "up"))


def action_bounds(compiled: CompiledBody, task: Task) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the least, the usual and the greatest action, (number,): joint targets [rad], of which the home posture is
    usual, or offsets of the tips [mm], of which 0 is usual."""
    if task.actions == "joints":
        low, high = compiled.model.actuator_ctrlrange[compiled.columns.ctrl].T
        return low, compiled.home[compiled.columns.qpos], high
    most = np.full(3 * len(LEGS), compiled.body.lengths.largest_tip_offset)
    return -most, np.zeros(len(most)), most


def checked_actions(
    actions: Any, shape: tuple[int, ...] | None, low: np.ndarray | float = -1.0, high: np.ndarray | float = 1.0
) -> np.ndarray:
    """Return actions as floats in their shape, within their bounds except for `ROUNDING`.

    Raises:
        InputError: the shape is another one, or a number is out of its bounds.
    """
    actions = np.asarray(actions, dtype=float)
    if actions.shape != shape:
        raise InputError(f"an action has the shape {actions.shape}; expected {shape}")
    if not (within := (actions >= low - ROUNDING) & (actions <= high + ROUNDING)).all():
        raise InputError(f"an action has {actions[~within][0]}, which is out of its bounds")
    return actions


def draw_start(rng: np.random.Generator, task: Task) -> np.ndarray:
    """Draw the next start of one insect, (1, leg) [mm]; with the same seed as `draw_starts`, the same starts."""
    return rng.uniform(task.stride.pep0, task.stride.aep0, (1, 6))
