"""A few starts walk on paper before anything else: what a plan refuses at the fastest velocity then ends no work."""

from copy import copy

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.asking import advanced, begin
from hexmj.controllers.losses import tells_losses
from hexmj.controllers.protocol import Controller
from hexmj.timing import Acceleration, Stride, observation_time, steps_within

FEW = 8
"""Starts that walk."""


def check_fastest(
    controller: Controller,
    starts: np.ndarray,
    velocities: ArrayLike,
    stride: Stride,
    acceleration: Acceleration | None = None,
) -> None:
    """Walk three periods where a time step is longest for whatever oscillates with V.

    Accelerating walks begin, too; plans that tell their losses by themselves just begin.

    Args:
        controller: plans the walk.
        starts: tips at time 0, (start, leg) [mm].
        velocities: V_r of all walks, (velocity,).
        stride: step range, lines of the tips and time step.
        acceleration: Eq. 11.

    Raises:
        InputError: the plan refuses to begin or to go on.
    """
    controller, velocity = copy(controller), float(np.max(velocities))  # what it keeps shall not be kept by cells
    if acceleration:
        begin(controller, starts, velocity, stride, acceleration, threads=1)
    plan = begin(controller, starts, velocity, stride, threads=1)
    time = observation_time("walk" if velocity > 0 else "start", velocity, stride)
    if not tells_losses(plan):
        advanced(plan, int(steps_within(time, stride)))
