"""What an episode is, whoever asks for it: actions, observations, rewards and ends.

The insect shall walk straight ahead at a commanded velocity.  An episode begins at a random start in S, settled as for
a physical walk.  One step of an environment is one step of the plan, with its substeps.  The controller runs along and
its plan is observed whatever the actions are: targets of all joints, held for the step ('joints'), or offsets to the
tips that the controller plans ('tips'), so that no offsets are its own walk, bit for bit that of
`measures.physical.physical_walk`.

Observations, all float64 and cut off at their bounds (`observation_bounds`):

- joint_angles, joint_velocities: (leg * joint,) [rad], [rad/s], in the order of `ctrl`
- orientation: unit quaternion of the root, (w, x, y, z); the walk should go along the world's x
- velocity: of the root, ahead, to the left and up, seen from its heading [mm/s]
- angular_velocity: of the root, in its own frame [rad/s]
- clearance: height of the trunk's lowest point, (1,) [mm]
- tips: in the root frame, (leg, axis) [mm]
- contact: (leg,) 1 where the ground carried the foot within the last `Conditions.contact_gap`, as the last physics step
  began
- margin: measured stability margin, (1,) [mm], from the feet in contact and the insect's own centre of mass;
  `Lengths.no_foot_margin`, out of any foot's reach, where no foot is in contact
- command: velocity to walk at, (1,) [mm/s]
- planned_stance: (leg,) 1 where the plan lets the leg stand
- planned_tips: in the root frame, (leg, axis) [mm], without offsets
- out_of_reach, with 'tips' only: (leg,) substeps of the last step in which the leg kept its last angles, because its
  planned tip with the offset could not be reached

The reward of a step is max(0, 1 - |v - c| / c) max(0, u), with the velocity v along the world's x after the step, the
command c and the upward component u of the body's vertical; it is 0 on a fall.  An episode ends on a fall, when the
trunk touches the ground (terminated); or after its duration, or where a foot comes to the end of a step, gap or hurdle
(truncated).

`observing` and `compiled_passes` compute all this, for every face the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.checks import check_types, numbers
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.timing import Stride, steps_within

Actions = Literal["joints", "tips"]
"""Kinds of actions: targets of the joints, or offsets to the tips."""

DOUBLE = np.dtype(np.float64)
"""What actions are computed in; NumPy has one such object, and to ask whether it is that takes no time."""

BEYOND_RANGE = 0.5
"""How far joints may be observed beyond their ranges, which give way [rad]."""

FASTEST_TURN = 200.0
"""Greatest velocity of a joint, and of the root about an axis, that is observed [rad/s]."""

FASTEST = 20.0
"""Greatest velocity of the root that is observed, in body heights fallen freely: sqrt(2 g h) at so many of them."""


@dataclass(frozen=True)
class Task:
    """What an episode is."""

    velocity: float = 0.3
    """Commanded V_r, 0 < V < 1, as a fraction of V_p."""
    actions: Actions = "joints"
    """What an action means."""
    controller: Controller = LDVS
    """Plans the walk."""
    conditions: Conditions = field(default_factory=Conditions)
    """Of the walk."""
    stride: Stride = field(default_factory=Stride)
    """Of the plan; its time step is that of the environment."""
    duration: float = 200.0
    """Of an episode [time units]."""

    def __post_init__(self) -> None:
        check_types(self)
        if not 0 < self.velocity < 1:
            raise InputError(
                f"velocity = {self.velocity}; expected 0 < V < 1, a fraction of the protraction velocity V_p"
            )
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
        """Velocity to walk at [mm/s]."""
        return self.velocity * self.conditions.vp


def task_of(settings: Mapping[str, Any]) -> Task:
    """A task by its settings' names.

    Raises:
        InputError: no such name, or a value that makes no sense.
    """
    valid = [one.name for one in fields(Task)]
    if unknown := set(settings) - set(valid):
        raise InputError(f"setting {min(unknown)!r:.80}; valid names: {', '.join(valid)}")
    return Task(**settings)


def observation_bounds(compiled: CompiledBody, task: Task) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Least and greatest value of every observation, each in its shape, by the observations' names in their order."""
    lengths, ranges = compiled.body.lengths, compiled.model.actuator_ctrlrange[compiled.columns.ctrl]
    far, tall = -lengths.no_foot_margin, compiled.body.standing_height
    fastest = np.sqrt(2.0 * compiled.weight / compiled.body.mass * FASTEST * tall)
    size, legs = (compiled.joints,), (len(LEGS),)
    bounds = {
        "joint_angles": (ranges[:, 0] - BEYOND_RANGE, ranges[:, 1] + BEYOND_RANGE),
        "joint_velocities": _alike(size, -FASTEST_TURN, FASTEST_TURN),
        "orientation": _alike((4,), -1.0, 1.0),
        "velocity": _alike((3,), -fastest, fastest),
        "angular_velocity": _alike((3,), -FASTEST_TURN, FASTEST_TURN),
        "clearance": _alike((1,), -lengths.shortest_leg, FASTEST * tall),
        "tips": _alike((6, 3), -far, far),
        "contact": _alike(legs, 0.0, 1.0),
        "margin": _alike((1,), -far, far),
        "command": _alike((1,), 0.0, lengths.fastest_swing),
        "planned_stance": _alike(legs, 0.0, 1.0),
        "planned_tips": _alike((6, 3), -far, far),
    }
    if task.actions == "tips":
        bounds["out_of_reach"] = _alike(legs, 0.0, float(task.substeps))
    return bounds


def action_names(compiled: CompiledBody, task: Task) -> tuple[str, ...]:
    """What the numbers of an action are for."""
    if task.actions == "joints":
        return compiled.body.joints
    return tuple(f"{leg}_{axis}" for leg in LEGS for axis in ("forward", "left", "up"))


def action_bounds(compiled: CompiledBody, task: Task) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least, usual and greatest action, (number,): of the joints' targets [rad], where posture home is usual, or of the
    tips' offsets [mm], where none are."""
    if task.actions == "joints":
        low, high = compiled.model.actuator_ctrlrange[compiled.columns.ctrl].T
        return low, compiled.home[compiled.columns.qpos], high
    most = np.full(3 * len(LEGS), compiled.body.lengths.largest_tip_offset)
    return -most, np.zeros(len(most)), most


def checked_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Actions as numbers in their shape; whether they are within bounds is seen when they are carried out.

    Raises:
        InputError: something else.
    """
    if not (type(actions) is np.ndarray and actions.dtype is DOUBLE):
        actions = numbers("action", actions)
    if actions.shape != shape:
        raise InputError(f"an action has the shape {actions.shape}; expected {shape}")
    return actions


def drawn(rng: np.random.Generator, task: Task) -> np.ndarray:
    """The next start of one insect, (1, leg) [mm]; those of `draw_starts` if the generator has the same seed."""
    return rng.uniform(task.stride.pep0, task.stride.aep0, (1, 6))


def _alike(shape: tuple[int, ...], low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    return np.full(shape, low), np.full(shape, high)
