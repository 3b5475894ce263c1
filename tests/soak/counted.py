"""A controller that notes each of its plans; a file of its own, as it is loaded by processes that compute cells."""

import os
from dataclasses import dataclass

import numpy as np

import hexmj
from hexmj.controllers import Plan
from hexmj.timing import Acceleration, Stride

LOG = "CRASH_LOG"
"""Variable with the name of the file of notes; outside the folder whose writes go wrong."""


@dataclass(frozen=True)
class Counted:
    """The network of the paper; notes that it was asked."""

    pull: float = 1.0
    name: str = "counted"

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> Plan:
        """See `Controller.begin`; V_r depends on `pull`, so that this can be searched."""
        note = f"V-{velocity[0]:g} {len(starts)}-{np.float64(self.pull).tobytes().hex()}\n"
        file = os.open(os.environ[LOG], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(file, note.encode())
        os.close(file)
        slower = velocity * min(1.0, abs(self.pull))
        return hexmj.LDVS.begin(starts, slower, stride, acceleration, threads)
