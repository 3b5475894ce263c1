"""Your own controller: six phase oscillators, coupled so that two tripods of legs alternate."""

from dataclasses import dataclass

import numpy as np

import hexmj
from hexmj.controllers import Step, stepwise

SIGN = np.array([1, -1, 1, -1, 1, -1])  # of a leg's tripod: L1, L3 and R2, or L2, R1 and R3


@dataclass(frozen=True)
class Tripod:
    """Every leg is an oscillator. Standing legs move with V_r; the coupling only shifts the time of lift-off."""

    pull: float = 1.0
    name: str = "tripod"
    mirrored = True

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """Begin a plan, see `hexmj.controllers.Controller`."""
        span, dt = stride.aep0 - stride.pep0, stride.dt
        x, stands, age = starts, np.ones(starts.shape, dtype=bool), (stride.aep0 - starts) / span

        def step(v):
            nonlocal x, stands, age  # age: elapsed part of the stance
            v = v[:, None]
            part = 1 / (1 + v)  # duty factor
            phase = np.where(stands, age * part, 1 - (stride.aep0 - x) / span * (1 - part))
            hand = SIGN * np.exp(2j * np.pi * phase)  # of each oscillator's clock
            mean = (hand[:, :3] + hand[:, 3:]).mean(axis=1, keepdims=True) / 2
            pulled = 1 + self.pull * (mean * hand.conj()).imag
            age = np.where(stands, np.minimum(age + pulled * v * dt / span, 1), 0)
            others_stand = np.stack([stands[:, 1::2].all(axis=1), stands[:, ::2].all(axis=1)] * 3, axis=1)
            x = np.where(stands, x - v * dt, x + dt)
            lifted = (age == 1) & others_stand | (x - v * dt < stride.pep_min)
            stands = np.where(stands, ~lifted, x > stride.aep0 - dt / 2)
            return Step(x, stands)

        return stepwise(step, starts, velocity, stride, acceleration)


if __name__ == "__main__":
    velocities = [0.3, 0.5]
    for controller in (Tripod(), hexmj.LDVS):
        kinematic = hexmj.flss(controller, velocities, n_starts=200)
        physical = hexmj.physical_flss(controller, velocities, n_starts=8)
        print(f"{controller.name}: FLSS at V = {velocities}: kinematic {kinematic.flss.values.round(3)},", end=" ")
        print(f"physical {physical.flss.values.round(3)}")
