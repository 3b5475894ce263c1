"""A controller with sensory feedback: a swing ends on ground contact, and a foot that loses contact searches for it."""

from dataclasses import dataclass

import numpy as np

import hexmj
from hexmj.controllers import Step, stepwise

TRIPODS = np.array([0, 2, 4]), np.array([1, 3, 5])
NEAR = 2.0  # a swing ends this far before AEP_0, where a tripod is stable already [mm]


@dataclass(frozen=True)
class Feeler:
    """Two tripods in turn: a tripod is lifted when it is at the rear and all six feet stand."""

    lift: float = 12.0  # height of a swing [mm]
    rise: float = 6.0  # speed of a foot that is lifted [mm per time unit]
    sink: float = 2.0  # speed of a foot that is lowered or searches [mm per time unit]
    level: float = 0.1  # speed of a standing foot towards height 0, so that the body follows the ground
    depth: float = 4.0  # greatest depth of a search [mm]
    name: str = "feeler"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """Begin a plan, see `hexmj.controllers.Controller`."""
        x, height, dt, front = starts, np.zeros(starts.shape), stride.dt, stride.aep0 - NEAR
        stands, contact, free = (np.full(starts.shape, value) for value in (True, True, False))

        def sense(sensed):
            contact[sensed.ids] = sensed.contact

        def step(v):
            nonlocal x, height, free, contact
            v = v[:, None]
            free = ~stands & (free | ~contact)  # has left the ground
            stands[free & contact | (height <= -self.depth)] = True
            for tripod in TRIPODS:
                tips = x[:, tripod]
                at_the_rear = (tips.mean(axis=1) <= stride.pep0) | (tips - v * dt < stride.pep_min).any(axis=1)
                stands[np.ix_(stands.all(axis=1) & at_the_rear, tripod)] = False
            path = np.where(x < front, np.minimum(self.sink * (front - x), self.lift), -self.depth)
            swung = np.maximum(np.minimum(height + self.rise * dt, path), height - self.sink * dt)
            level = np.clip(height, -self.level * dt, self.level * dt)
            height = np.where(stands, height - np.where(contact, level, self.sink * dt), swung).clip(-self.depth)
            x = np.where(stands, np.maximum(x - v * dt, stride.pep_min), np.maximum(x, np.minimum(x + dt, front)))
            contact = height <= 0  # of a kinematic walk; in physics, `sense` sets it before the next step
            return Step(x, stands, height=height)

        return stepwise(step, starts, velocity, stride, acceleration, sense)


if __name__ == "__main__":
    for height in (0.0, 2.0, 4.0):
        ground = hexmj.Conditions(ground="step", ground_height=height) if height else hexmj.Conditions()
        result = hexmj.compare(
            {"feeler": Feeler(), "ldvs": hexmj.LDVS}, [0.5], n_starts=6, observation_time=150.0, conditions=ground
        )
        fell = {name: result.physical.sel(controller=name).item() for name in ("feeler", "ldvs")}
        print(
            f"a step of {height:g} mm at V = 0.5: {fell['feeler']:.2f} of the feelers fall, {fell['ldvs']:.2f} of LDVS"
        )
