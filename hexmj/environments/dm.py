"""The insect as a dm_env environment on dm_control; what an episode is stands in `task`.

Actions have units here: targets [rad] within the joints' ranges, or offsets [mm]: forward, left, up.  A fall ends an
episode with discount 0, its time or the end of the ground with discount 1.  A simulation that diverges raises
dm_control's PhysicsError.  Contacts are those of the last substep, known once it is done.
"""

import os
import warnings
from dataclasses import dataclass
from typing import Any

import glfw
import numpy as np

from hexmj.rendering.gl import import_what_clashes

with warnings.catch_warnings():
    if "MUJOCO_GL" not in os.environ:  # without a screen GLFW only warns, and dm_control would never come to EGL
        warnings.simplefilter("error", glfw.GLFWError)
    import_what_clashes()
    from dm_control import mujoco
from dm_control.mujoco import wrapper
from dm_control.rl import control
from dm_env import specs

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import check_home, compile_body
from hexmj.checks import given
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller
from hexmj.environments.compiled_passes import beyond, worth
from hexmj.environments.single_body import Alone
from hexmj.environments.task import (
    Actions,
    Task,
    action_bounds,
    action_names,
    checked_actions,
    drawn,
    observation_bounds,
)
from hexmj.environments.walkers import Acted, Walkers
from hexmj.errors import InputError
from hexmj.physics.backend import Diverged
from hexmj.physics.fine_steps import Shown
from hexmj.starts import check_draw
from hexmj.timing import Stride

ONLY = np.array([0])
"""The index of the only insect."""


def load(
    velocity: float = 0.3,
    *,
    actions: Actions = "joints",
    controller: Controller = LDVS,
    conditions: Conditions | None = None,
    stride: Stride | None = None,
    duration: float = 200.0,
    seed: int = 0,
) -> control.Environment:
    """The environment; it can be given to `dm_control.viewer.launch`.

    Args:
        velocity: commanded V_r, 0 < V < 1, as a fraction of V_p.
        actions: 'joints', targets of all joints, (leg * joint,) [rad] within the joints' ranges; or 'tips',
            offsets to the planned tips, (leg * axis,) [mm]: forward, left, up.
        controller: plans the walk.
        conditions: of the walk.
        stride: of the plan; its time step is that of the environment.
        duration: of an episode [time units].
        seed: of the starts; the episodes take those of `draw_starts` one after the other.

    Raises:
        InputError: a value that makes no sense; here, or for an action in `step`.
    """
    conditions, stride = given("conditions", conditions, Conditions), given("stride", stride, Stride)
    task = Task(velocity, actions, controller, conditions, stride, duration)
    compiled = compile_body(conditions, conditions.timestep(stride))
    check_home(compiled)
    physics = InsectPhysics.from_model(wrapper.MjModel(compiled.model))
    physics.compiled = compiled
    return control.Environment(physics, Walking(task, seed), n_sub_steps=task.substeps)


class InsectPhysics(mujoco.Physics):
    """The insect in dm_control, and what is measured on it."""

    compiled: CompiledBody
    """The insect and its conditions; set by `load`."""
    shown: Shown
    """What the last step has shown of it, the only one: sensors, torques and depth, each (1, substep, ...)."""

    def _reload_from_data(self, data: wrapper.MjData) -> None:
        super()._reload_from_data(data)
        self._control = data.ctrl
        self._rows = np.array(data.ctrl, ndmin=2)
        self._alone: Alone | None = None

    def copy(self, share_model: bool = False) -> "InsectPhysics":
        """As planners need it; goes on the same way."""
        copied = super().copy(share_model)
        copied.compiled = self.compiled
        return copied

    def __getstate__(self) -> tuple[wrapper.MjData, CompiledBody]:
        return self.data, self.compiled

    def __setstate__(self, state: tuple[wrapper.MjData, CompiledBody]) -> None:
        data, self.compiled = state
        self._reload_from_data(data)

    def after_reset(self) -> None:
        """Make everything current; dm_control would leave out the actuators, which the first step then lacks."""
        self.forward()

    def set_control(self, control: np.ndarray) -> None:
        """Targets of the joints [rad]: (actuator,), or (substep, actuator), one row for each substep to come."""
        self._rows = np.array(control, ndmin=2)
        self._control[:] = self._rows[0]

    def step(self, nstep: int = 1) -> None:
        """Advance by `nstep` substeps; finely if a foot strikes the ground in them, see `fine_steps`."""
        rows = self._rows
        rows[0] = self._control
        if len(rows) < nstep:
            rows = np.concatenate([rows, np.repeat(rows[-1:], nstep - len(rows), axis=0)])
        try:
            self.shown = self.alone.take(ONLY, rows[np.newaxis, :nstep])
        except Diverged as error:
            raise control.PhysicsError(f"the simulation diverged: {error.kinds}") from None
        self._rows = rows[min(nstep, len(rows) - 1) :]
        if len(rows) > nstep:
            self._control[:] = self._rows[0]

    @property
    def alone(self) -> Alone:
        """What takes its steps; another one where dm_control has given it other data."""
        if self._alone is None:
            self._alone = Alone(self.compiled, self.model.ptr, self.data.ptr)
        return self._alone


@dataclass(eq=False)
class Walking(control.Task):
    """Walk straight ahead.

    Starts are drawn from `_random`, which may be replaced by any of NumPy's generators, as wrappers of dm_control do.
    """

    task: Task
    seed: int

    def __post_init__(self) -> None:
        """Draw the starts of `draw_starts` by the seed."""
        self._random = np.random.default_rng(check_draw(1, self.seed)[1])

    def __getstate__(self) -> dict[str, Any]:
        """Refuse copies and pickles of an episode, whose insect MuJoCo steps in memory that they would not share."""
        if hasattr(self, "_walkers"):
            raise InputError(
                "an environment that was reset can be neither copied nor pickled; expected its physics, or another one"
            )
        return self.__dict__

    @property
    def random(self) -> np.random.Generator:
        """What the starts are drawn from, as dm_control's suite shows it; its wrapper `action_noise` draws, too."""
        return self._random

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start."""
        self._walkers = Walkers(self.task, physics.compiled, physics.alone, physics.alone.take, count=1, threads=1)
        self._acted, self._spec = Acted(*np.zeros((3, 1))), self.action_spec(physics)
        self._bounds = self._spec.minimum, self._spec.maximum
        self._walkers.begin(ONLY, drawn(self._random, self.task))

    def before_step(self, action: np.ndarray, physics: InsectPhysics) -> None:
        """Advance the plan by one step and tell the joints where to go."""
        self._walkers.check_begun()
        spec, action = self._spec, checked_actions(action, self._spec.shape)
        if (i := beyond(action, *self._bounds)) >= 0:
            name, least, most = action_names(physics.compiled, self.task)[i], spec.minimum[i], spec.maximum[i]
            raise InputError(f"the action's {name} = {action[i]}; expected {least:.4g} to {most:.4g}")
        if self._acted.terminated or self._acted.truncated:
            return
        self._look(physics)
        self._walkers.begun = False  # until the step is done
        physics.set_control(self._walkers.control(action[np.newaxis])[0])

    def after_step(self, physics: InsectPhysics) -> None:
        """Judge the step."""
        self._acted = self._walkers.judge(physics.shown)
        self._walkers.begun = True

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Bounds of an action; the names of its numbers are joined by tabs."""
        low, _, high = action_bounds(physics.compiled, self.task)
        return specs.BoundedArray(
            low.shape, float, low, high, name="\t".join(action_names(physics.compiled, self.task))
        )

    def observation_spec(self, physics: InsectPhysics) -> dict[str, specs.BoundedArray]:
        """The specs of all observations by their names."""
        bounds = observation_bounds(physics.compiled, self.task)
        return {name: specs.BoundedArray(low.shape, float, low, high, name) for name, (low, high) in bounds.items()}

    def get_observation(self, physics: InsectPhysics) -> dict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        self._look(physics)
        return self._walkers.observer.named(self._walkers.observations()[0])

    def get_reward(self, physics: InsectPhysics) -> float:
        """See `task`."""
        here = physics.alone
        return 0.0 if self._acted.terminated else worth(here.qvel[0], here.rotation[0], self.task.command)

    def get_termination(self, physics: InsectPhysics) -> float | None:
        """Discount 0 on a fall, 1 when the time or the ground is over, nothing before."""
        if self._acted.terminated:
            return 0.0
        return 1.0 if self._acted.truncated else None

    def _look(self, physics: InsectPhysics) -> None:
        if physics.alone is not self._walkers.bodies:
            self._walkers.look(physics.alone)
