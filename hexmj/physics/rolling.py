"""Rolling of a spherical foot that is fixed to the last link of its leg."""

from typing import Any

import numpy as np

from hexmj.body import ROOT_QPOS
from hexmj.jitted import part
from hexmj.rotations import matrix


@part
def rolled(before: Any, now: Any, leg: int, rolling: Any) -> Any:
    """Return how far a foot's centre moves, along the world's x and y [mm], if its lowest point does not slide.

    The centre moves by the cross product of the rotation of the last link and the radius, which points up.

    Args:
        before: `qpos` before a physics step, (position,).
        now: `qpos` after it, (position,).
        leg: index of the leg.
        rolling: `HingeChains.axis` and `HingeChains.zero`, and the radius of the feet [mm].
    """
    axes, zero, radius = rolling
    joints, x, y, z = zero.shape[1], 0.0, 0.0, 0.0  # rotation of the last link relative to the root
    for joint in range(joints - 1, -1, -1):  # from the foot to the body
        a, b, c = axes[leg, joint]
        column = ROOT_QPOS + leg * joints + joint
        if joint < joints - 1:
            angle = 0.5 * (now[column] + before[column]) - zero[leg, joint]
            cosine, sine = np.cos(angle), np.sin(angle)
            along = (1.0 - cosine) * (a * x + b * y + c * z)
            across = b * z - c * y, c * x - a * z, a * y - b * x
            x = cosine * x + sine * across[0] + along * a
            y = cosine * y + sine * across[1] + along * b
            z = cosine * z + sine * across[2] + along * c
        angle = now[column] - before[column]
        x, y, z = x + angle * a, y + angle * b, z + angle * c
    w, i, j, k = now[3], now[4], now[5], now[6]
    dw, di, dj, dk = w - before[3], i - before[4], j - before[5], k - before[6]
    root_x = 2.0 * (w * di - i * dw + j * dk - k * dj)
    root_y = 2.0 * (w * dj - j * dw + k * di - i * dk)
    xx, xy, xz, yx, yy, yz, _, _, _ = matrix(w - 0.5 * dw, i - 0.5 * di, j - 0.5 * dj, k - 0.5 * dk)
    return radius * (root_y + yx * x + yy * y + yz * z), -radius * (root_x + xx * x + xy * y + xz * z)
