"""A free gait: a planner lifts the leg that needs it most, if the body stays stable without it.

After McGhee and Iswandhi 1979 (IEEE Trans. Syst. Man Cybern. 9, 176) and Kugushev and Jaroshevskij 1975. The
*kinematic margin* of a standing leg is the time until its tip leaves the leg's reach. Of the legs that have made a step
of at least `least_step`, the planner lifts the leg with the least kinematic margin without which the body stays stable
for the whole swing, and repeats this until no leg can be lifted. The swing ends at the front end of the leg's line.

Unlike the sources, the planner knows no terrain and chooses no footholds besides the ends of the lines, and it does not
look ahead beyond one swing. It plans curves itself, with the lines of `steered.Lines`. Fitted by us: both fields, for
little slip and few falls at V = 0.3. Sensed: nothing. A leg that reaches the end of its reach is lifted in any case.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.controllers.steered import Lines, feet_on
from hexmj.jitted import jitted
from hexmj.stability import margin_of
from hexmj.starts import checked_velocities
from hexmj.timing import AT_SPEED, Acceleration, Stride, commanded_velocities
from hexmj.validate import number
from hexmj.walks import PlannedWalk

EVERY = 5
"""Number of steps between two decisions."""


@dataclass(frozen=True)
class FreeGait:
    """A planner of stable steps, a `protocol.CommandedController` and a `protocol.SteerableController`."""

    margin: float = 2.0
    """Minimum stability margin without a lifted leg, until its swing has ended [mm]."""
    least_step: float = 12.0
    """Minimum distance of a tip from the front end of its line at which the leg may be lifted [mm]."""
    name: str = "free"

    def __post_init__(self) -> None:
        number("margin", self.margin, 0.0, 30.0)
        number("least_step", self.least_step, 0.1, 100.0)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> "FreePlan":
        """See `protocol.Controller.begin`."""
        v = checked_velocities(velocity, len(starts), acceleration)
        return FreePlan(self, starts, v, np.array([1.0, 0.0, 0.0]), stride, acceleration)

    def begin_at_speed(self, starts, velocity, stride, acceleration=None, threads=None) -> "FreePlan":
        """See `protocol.SteerableController.begin_at_speed`."""
        v = checked_velocities(velocity, len(starts), acceleration)
        return FreePlan(self, starts, v, np.array([1.0, 0.0, 0.0]), stride, acceleration, AT_SPEED)

    def begin_commanded(self, starts, command, stride, threads=None) -> "FreePlan":
        """See `protocol.CommandedController.begin_commanded`."""
        return FreePlan(self, starts, np.ones(len(starts)), np.asarray(command, dtype=float), stride)


class FreePlan:
    """The plan of a `FreeGait`, a `protocol.CommandedPlan` and a `protocol.SteerablePlan`."""

    def __init__(
        self,
        settings: FreeGait,
        starts: np.ndarray,
        velocity: np.ndarray,
        command: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        age: int = 0,
    ) -> None:
        """Begin with feet that stand on the lines as `starts`, (start, leg) [mm], stand on the step range.

        The body moves by the command times the velocity. The acceleration began `age` steps before.
        """
        self._settings, self._velocity, self._acceleration = settings, velocity, acceleration
        self._age = np.full(len(starts), age)
        self.stride, self.done, self.made_for, self._origin = stride, 0, None, np.array(stride.geometry.origin)
        lines = Lines.of(command, stride)
        self._feet = feet_on(lines, starts, stride)
        self.starts = starts if lines.straight else self._feet[..., 0] - self._origin
        self.y = self._feet[..., 1].copy()
        self._goals, self._stands = self._feet.copy(), np.ones(starts.shape, dtype=bool)
        self.follow(command)

    def follow(self, command: np.ndarray) -> None:
        """See `protocol.CommandedPlan.follow`."""
        self._command = np.asarray(command, dtype=float)
        stride, lines = self.stride, Lines.of(self._command, self.stride)
        full = lines.direction * lines.longest[:, None]
        middle = (stride.aep0 + stride.pep0) / 2
        behind = np.abs(lines.direction[:, 0]) * (stride.pep0 - stride.pep_min)  # lines along the body are longer
        front = lines.neutral + (stride.aep0 - middle) * full
        rear = lines.neutral + (stride.pep0 - middle) * full - behind[:, None] * lines.direction
        self._lines = front, rear, lines.direction

    @property
    def tips(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._feet[..., 0] - self._origin

    @property
    def standing(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._stands

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._feet[..., 0] = np.where(tips == self.tips, self._feet[..., 0], tips + self._origin)
        self._stands = standing

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        legs = which[:, None]
        self.see(np.where(legs, tips, self.tips), self._stands | legs)
        self._goals = np.where(legs[..., None], self._feet, self._goals)
        self.slow_down(which)

    def slow_down(self, which: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._age[which] = 0

    def set_velocity(self, velocity: np.ndarray) -> None:
        """See `protocol.Plan`."""
        self._velocity = velocity

    def advance(self, steps: int) -> PlannedWalk:
        """See `protocol.Plan`."""
        v = np.array(commanded_velocities(self._velocity, self._age, steps, self.stride, self._acceleration))
        twists = v[..., None] * self._command
        shape = (*v.shape, 6)
        feet, goals, stance = np.empty((*shape, 2)), np.empty((*shape, 2)), np.empty(shape, dtype=bool)
        state, limits = (self._feet, self._goals, self._stands), (self._settings.margin, self._settings.least_step)
        _plan(state, twists, self._lines, limits, self.stride.dt, self._age, (feet, goals, stance))
        self.done, self._age = self.done + steps, self._age + steps
        time = np.arange(self.done - steps + 1, self.done + 1) * self.stride.dt
        tips = {"x": feet[..., 0] - self._origin, "y": feet[..., 1], "stance": stance}
        aims = {"aep": goals[..., 0] - self._origin, "aep_y": goals[..., 1], "height": np.broadcast_to(np.nan, shape)}
        forward, left, turn = np.moveaxis(twists, 2, 0)
        motion = {"left": left, "turn": turn, "geometry": self.stride.geometry}
        return PlannedWalk(time, forward, **tips, **aims, **motion)


@jitted
def _plan(state: Any, twists: Any, lines: Any, limits: Any, dt: float, age: Any, out: Any) -> None:
    """Write the tips and goals of all legs, (step, start, leg, 2), and their stance, (step, start, leg), to `out`."""
    feet, goals, stands = state
    front, _, _ = lines
    all_feet, all_goals, all_stance = out
    for start in range(feet.shape[0]):
        f, g, s = feet[start], goals[start], stands[start]
        for n in range(twists.shape[0]):
            forward, left, turn = twists[n, start]
            cosine, sine = np.cos(turn * dt), np.sin(turn * dt)
            moves = forward != 0.0 or left != 0.0 or turn != 0.0
            for leg in range(6):
                x, y = f[leg]
                if s[leg]:
                    x, y = x - forward * dt, y - left * dt
                    f[leg, 0], f[leg, 1] = cosine * x + sine * y, cosine * y - sine * x
                    continue
                if moves:
                    g[leg] = front[leg]
                way = np.hypot(g[leg, 0] - x, g[leg, 1] - y)
                part = min(dt / way, 1.0) if way > 0.0 else 1.0
                f[leg, 0], f[leg, 1] = x + part * (g[leg, 0] - x), y + part * (g[leg, 1] - y)
                s[leg] = way <= dt
            if moves:
                _lift(f, g, s, twists[n, start], lines, limits, (age[start] + n) % EVERY == 0)
            all_feet[n, start], all_goals[n, start], all_stance[n, start] = f, g, s


@jitted
def _lift(f: Any, g: Any, s: Any, twist: Any, lines: Any, limits: Any, decides: bool) -> None:
    """Lift the legs of one start at the end of their reach and, if the plan decides now, those that it can spare."""
    front, rear, direction = lines
    least_margin, least_step = limits
    forward, left, turn = twist
    time, way = np.full(6, np.inf), np.zeros(6)
    for leg in range(6):
        if s[leg]:
            speed = np.hypot(forward - turn * f[leg, 1], left + turn * f[leg, 0])
            along = direction[leg]
            ahead = (front[leg, 0] - f[leg, 0]) * along[0] + (front[leg, 1] - f[leg, 1]) * along[1]
            room = (f[leg, 0] - rear[leg, 0]) * along[0] + (f[leg, 1] - rear[leg, 1]) * along[1]
            time[leg], way[leg] = room / max(speed, 1e-9), ahead
            if room <= 0.0:
                s[leg], g[leg] = False, front[leg]
    if not decides:
        return
    for leg in np.argsort(time):
        if s[leg] and time[leg] < np.inf and way[leg] >= least_step:
            s[leg] = False
            swing = np.hypot(front[leg, 0] - f[leg, 0], front[leg, 1] - f[leg, 1])
            if _stays(f, s, twist, swing, least_margin):
                g[leg] = front[leg]
            else:
                s[leg] = True


@jitted
def _stays(f: Any, s: Any, twist: Any, duration: float, least: float) -> bool:
    """Return whether the stability margin of the standing legs stays at `least` [mm] while the body moves."""
    forward, left, turn = twist
    moved = np.empty((6, 2))
    for part in (0.0, 0.5, 1.0):
        for leg in range(6):
            moved[leg, 0] = f[leg, 0] - (forward - turn * f[leg, 1]) * part * duration
            moved[leg, 1] = f[leg, 1] - (left + turn * f[leg, 0]) * part * duration
        if margin_of(moved, s) < least:
            return False
    return True
