"""Reflexes around any steerable controller, which adapt the heights of its feet to the ground.

After Espenschied, Quinn, Beer and Chiel 1996 (Robotics and Autonomous Systems 18, 59), who took them from insects:

- **Stance**: a foot that meets the ground early begins its stance there, and the leg keeps this height. All legs then
  drift so that the mean height becomes 0, and against the tilt of the body.
- **Searching**: a leg that should stand but has no contact is lowered until it finds the ground.
- **Elevator**: a foot that meets an obstacle far before its AEP is raised and continues its swing.

Unlike the source, the controller receives sensory feedback, and reflexes change heights but not places of the feet.
Fitted by us: all fields. Sensed: tips, contacts and tilt.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexmj.controllers.feedback import SensedPlan, SensoryFeedback
from hexmj.controllers.protocol import Sensed, SteerablePlan
from hexmj.validate import number
from hexmj.walks import PlannedWalk, joined


@dataclass(frozen=True)
class Reflexes(SensoryFeedback):
    """A steerable controller with sensory feedback and three reflexes."""

    lowest: float = 8.0
    """Depth to which a leg searches for the ground [mm]."""
    searching: float = 0.5
    """Speed at which a leg searches [V_p]."""
    elevation: float = 4.0
    """Height by which the elevator reflex raises a foot [mm]."""
    near: float = 3.0
    """Distance from the AEP within which contact ends a swing [mm]."""
    relaxing: float = 0.02
    """Rate at which the mean height of the feet returns to 0 [1 / time unit]."""
    levelling: float = 0.02
    """Rate at which the legs move against a tilt, over their distance from O [1 / time unit]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("lowest", "searching", "elevation", "near", "relaxing", "levelling"):
            number(name, getattr(self, name), 0.0, 100.0)

    @property
    def name(self) -> str:
        """Name of the wrapped controller, followed by 'with reflexes'."""
        return f"{self.controller.name} with reflexes"

    def wrap(self, plan: Any) -> "ReflexPlan":
        """See `SensoryFeedback.wrap`."""
        super().wrap(plan)  # raises InputError if the plan does not suit
        return ReflexPlan(plan, self)


class ReflexPlan(SensedPlan):
    """A `protocol.FeedbackPlan` whose legs adapt their heights to the ground."""

    def __init__(self, plan: SteerablePlan, reflexes: Reflexes) -> None:
        """Wrap a plan that is at time 0."""
        super().__init__(plan)
        self._reflexes, self._level = reflexes, np.zeros(plan.starts.shape)
        self._rest = np.full(plan.starts.shape, np.nan)  # (start, leg) height of the tips when first sensed [mm]
        self._aep = np.full(plan.starts.shape, self.stride.aep0)

    def sense(self, sensed: Sensed) -> None:
        """Receive the state of the legs, and set the heights of the legs that have gained contact or have none."""
        ids, own, dt = sensed.ids, self._reflexes, self.stride.dt
        self._rest[ids] = np.where(np.isnan(self._rest[ids]), sensed.tips[..., 2], self._rest[ids])
        swings, level = ~self._stance[ids], self._level[ids]
        x = sensed.tips[..., 0] - np.array(self.stride.geometry.origin)
        hits = sensed.gained & swings
        early = hits & (self._aep[ids] - x > own.near)
        lands = hits & ~early
        found = sensed.tips[..., 2] - self._rest[ids]
        level = np.where(lands, found, level + own.elevation * early)
        searches = self._stance[ids] & ~sensed.contact & (level > -own.lowest)
        level = level - own.searching * dt * searches
        stands = self._stance[ids] | lands
        mean = (level * stands).sum(axis=1, keepdims=True) / np.maximum(stands.sum(axis=1, keepdims=True), 1)
        lean = sensed.tilt[:, :1] * sensed.tips[..., 0] + sensed.tilt[:, 1:] * sensed.tips[..., 1]
        self._level[ids] = level - dt * (own.relaxing * mean + own.levelling * lean)
        super().sense(replace(sensed, gained=sensed.gained & ~early))

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next `steps` steps, with the heights of the ground that the legs expect."""
        parts = []
        for _ in range(steps):
            walk = super().advance(1)
            self._aep = np.where(np.isnan(walk.aep[0]), self.stride.aep0, walk.aep[0])
            parts.append(replace(walk, level=self._level[None].copy()))
        return joined(parts)
