"""A controller that cannot plan everywhere, and says so."""

from dataclasses import dataclass

from hexmj import LDVS
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.errors import InputError


@dataclass(frozen=True)
class Coarse(Cruse1998):
    """LDVS up to V = 0.4, with steps of 0.2 time units or longer."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        if velocity.max() > 0.4 or stride.dt < 0.2:
            raise InputError(f"V = {velocity.max()}, dt = {stride.dt}; expected at most 0.4, and at least 0.2")
        return super().begin(starts, velocity, stride, acceleration, threads)


COARSE = Coarse(LDVS.weights, name="coarse")
