"""What a walk costs: the positive work of the joints, and the greatest torque of one, chunk by chunk."""

import numpy as np

from hexmj.physics.chunks import Chunk
from hexmj.physics.settling import Settled


class EffortSoFar:
    """Adds up over the chunks of `drive.drive`, each start until it falls.

    Work is the sum over joints and physics steps of max(torque x speed, 0) h: a joint that is moved against its torque
    does no work, and gives none back.  The torque is that which acted over a step, see `Chunk.torque`.
    """

    work: np.ndarray
    """(start,) [g mm^2/s^2]."""
    torque: np.ndarray
    """(start,) greatest torque of a joint over its limit."""

    def __init__(self, settled: Settled) -> None:
        """Begin with nothing."""
        size, compiled = len(settled.starts), settled.compiled
        self.work, self.torque = np.zeros(size), np.zeros(size)
        self._columns, self._limits = compiled.columns, compiled.torque_limits
        self._rows = np.zeros((size, 0, 2, compiled.joints))  # the last one, angles and torques, of the chunk before

    def add(self, chunk: Chunk) -> None:
        """Take in one chunk; what happened in its last step is known with the next one."""
        before = self._rows[chunk.ids]
        now = np.stack([chunk.qpos[..., self._columns.qpos], chunk.torque], axis=2)
        rows = np.concatenate([before, now], axis=1)
        turned, torques = np.diff(rows[:, :, 0], axis=1), rows[:, :-1, 1]
        walking = np.arange(rows.shape[1] - 1) - before.shape[1] + 1 < chunk.valid[:, None]
        self.work[chunk.ids] += (np.maximum(torques * turned, 0.0).sum(axis=2) * walking).sum(axis=1)
        share = (np.abs(torques) / self._limits).max(axis=2) * walking
        self.torque[chunk.ids] = np.maximum(self.torque[chunk.ids], share.max(axis=1, initial=0.0))
        self._rows = np.zeros((len(self.work), 1, *now.shape[2:]))
        self._rows[chunk.ids] = rows[:, -1:]
