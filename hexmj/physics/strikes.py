"""Feet that strike the ground: a step of the network in which one would sink in is taken again, more finely.

A body that tips, or a swing that ends early, brings a foot down at 0.4 m/s and more.  One physics step of 0.625 ms
takes it 0.25 mm into the ground before any contact can act, so it needs shorter steps and a contact as hard as they
allow, of two steps: the deepest foot of 30 starts (LDVS, V = 0.5) was 0.47 mm deep at a quarter of the step with the
usual contact, 0.10 mm with both.  All walks would take four times as long, and few of the network's steps need it:
0.06, 0.17 and 0.9 % at V = 0.3, 0.5 and 0.8 (LDVS, 100 starts).  At 5 m/s, after a push, some need a sixteenth.

Whether a step is taken again depends on nothing but its own insect, so results do not depend on the batch.
"""

import numpy as np

SINK = 0.02
"""How deep a foot may be in the ground, as a share of the standing height."""

FINER, FINEST = 4, 64
"""Into how many parts a physics step is divided, again and again while a foot sinks in; and into how many at most."""

BRAKED = 0.5
"""Share of its speed that a foot in the ground is taken to keep over a physics step.

Measured are 0.2 to 0.4 over 0.625 ms with a contact of two steps, 0.6 to 0.7 over 0.25 ms with one of five (LDVS, 99 %
of the feet faster than 0.08 m/s).  Too low a share lets a foot go on to the next step, where it is still stopped; 1
takes three times as many steps again.
"""


def strikes(depth: np.ndarray, substeps: int, standing_height: float) -> np.ndarray:
    """In which physics steps a foot gets too deep, or will be too deep one step later.

    The latter is asked only where a step of the network ends: the next one can be taken again from there, not from
    before, and then it would begin with a foot that is too deep and too fast.

    Args:
        depth: of the feet before the first and after each physics step, (..., 1 + step, leg) [mm]; negative above
            ground.  It begins where a step of the network begins.
        substeps: physics steps in one of the network.
        standing_height: what `SINK` is a share of [mm].

    Returns:
        (..., step)
    """
    after, before, last = depth[..., 1:, :], depth[..., :-1, :], slice(substeps - 1, None, substeps)
    one_later = after + np.where(after > 0, BRAKED, 1.0) * (after - before)
    deepest = after.copy()
    deepest[..., last, :] = np.maximum(after, one_later)[..., last, :]
    return deepest.max(axis=-1) > SINK * standing_height


def in_whole_steps(sensors: np.ndarray, fine: int, touch: slice) -> np.ndarray:
    """What sensors show as each step begins that was taken in `fine` parts; forces are the means over its parts.

    Args:
        sensors: before each part, (..., step * part, column).
        fine: parts in a step.
        touch: columns of the forces.

    Returns:
        (..., step, column)
    """
    parts = sensors.reshape(*sensors.shape[:-2], -1, fine, sensors.shape[-1])
    whole = parts[..., 0, :].copy()
    whole[..., touch] = parts[..., touch].mean(axis=-2)
    return whole
