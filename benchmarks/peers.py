"""What others would write first: the same network in plain Numba and in vectorised NumPy.

Both give the answers of `hexmj.first_loss` (tests/test_benchmarks.py) with the usual stride and the printed order.
"""

from math import inf

import numpy as np
from numba import njit

from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.controllers.cruse1998.weights import general
from hexmj.legs import MIRROR, N2, N4
from hexmj.threads import run_blocks
from hexmj.timing import Acceleration, Stride, steps_within

STRIDE = Stride()
AEP0, PEP0, PEP_MIN, DT = STRIDE.aep0, STRIDE.pep0, STRIDE.pep_min, STRIDE.dt
ORIGIN, PER_Y = STRIDE.geometry.origin, tuple(1 / abs(y) for y in STRIDE.geometry.y)
REAR = tuple(n[0] if n else d for d, n in enumerate(N2))
FRONT = tuple(n[0] if n else d for d, n in enumerate(N4))
CONTRA = MIRROR


def numba_first_loss(
    starts: np.ndarray,
    controller: Cruse1998,
    velocity: float,
    duration: float,
    acceleration: Acceleration | None = None,
    threads: int = 2,
) -> np.ndarray:
    """Start after start, leg after leg, on two threads: (start,) [time units], inf where there is no loss."""
    w, steps = general(controller.weights), int(steps_within(duration, STRIDE))
    tables = np.stack([w.p1, w.p2, w.p31, w.p32, w.p33, w.p34, w.p4])
    v_start, rate = (acceleration.start, acceleration.rate) if acceleration else (velocity, 0.0)
    lost = np.empty(len(starts))

    def work(begin: int, end: int) -> None:
        _loop(starts[begin:end], tables, v_start, velocity, rate, steps, lost[begin:end])

    run_blocks(work, len(starts), 64, threads)
    return lost


@njit(cache=True, nogil=True)
def _loop(starts, tables, v_start, v_final, rate, steps, lost):
    p1, p2, p31, p32, p33, p34, p4 = tables
    for i in range(len(starts)):
        x, s, s_old, aep = starts[i].copy(), np.ones(6), np.ones(6), np.full(6, AEP0)
        pep_shift, aep_shift, pep_next, aep_next = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
        lost[i] = inf
        v = v_start
        for n in range(1, steps + 1):
            for d in range(6):
                rear, contra, front = REAR[d], CONTRA[d], FRONT[d]
                pep = (s[rear] - 1) * p1[d, rear] + (s[contra] - 1) * p1[d, contra]
                if s[rear] == 1 and s_old[rear] == 0:
                    pep += (AEP0 - PEP_MIN) * p2[d, rear]
                for e in (front, contra):
                    ahead = p31[d, e] + p34[d, e] * v - x[e]
                    pep += min((p32[d, e] if ahead >= 0 else p33[d, e]) * s[e] * ahead, 4.0)
                pep_next[d] = pep
                crossed = ORIGIN[d] + x[d] >= ORIGIN[front] + x[front]
                aep_next[d] = (PEP_MIN - aep[d]) * p4[d, front] if crossed else 0.0
            front_left = front_right = -inf
            rear_left = rear_right = inf
            for d in range(6):
                s_old[d] = s[d]
                x[d] = x[d] - v * DT * s[d] + DT * (1 - s[d])
                aep[d] = AEP0 + aep_shift[d]
                pep = max(PEP0 + pep_shift[d], PEP_MIN)
                if s[d] == 0 and x[d] > aep[d]:
                    s[d] = 1
                elif s[d] == 1 and x[d] < pep:
                    s[d] = 0
                pep_shift[d], aep_shift[d] = pep_next[d], aep_next[d]
                if s[d] == 1:
                    u = (ORIGIN[d] + x[d]) * PER_Y[d]
                    if d < 3:
                        front_left, rear_left = max(front_left, u), min(rear_left, u)
                    else:
                        front_right, rear_right = max(front_right, u), min(rear_right, u)
            if front_left + front_right <= 0 or rear_left + rear_right >= 0:
                lost[i] = n * DT
                break
            v = v_start + rate * (n * DT) if v < v_final else v_final


def numpy_first_loss(starts: np.ndarray, controller: Cruse1998, velocity: float, duration: float) -> np.ndarray:
    """All starts at once, (leg, start), without the ones that have lost: (start,) [time units], inf for no loss."""
    w, d = general(controller.weights), np.arange(6)
    rear, contra, front = np.array(REAR), np.array(CONTRA), np.array(FRONT)
    origin, per_y = np.array(ORIGIN)[:, None], np.array(PER_Y)[:, None]

    def of(table: np.ndarray, source: np.ndarray) -> np.ndarray:
        return table[d, source][:, None]

    lost, ids = np.full(len(starts), inf), np.arange(len(starts))
    x = starts.T.copy()
    s, s_old, aep = np.ones_like(x), np.ones_like(x), np.full_like(x, AEP0)
    pep_shift, aep_shift = np.zeros_like(x), np.zeros_like(x)
    for n in range(1, int(steps_within(duration, STRIDE)) + 1):
        pep_next = (s[rear] - 1) * of(w.p1, rear) + (s[contra] - 1) * of(w.p1, contra)
        pep_next += (AEP0 - PEP_MIN) * of(w.p2, rear) * (s[rear] * (1 - s_old[rear]))
        for e in (front, contra):
            ahead = of(w.p31, e) + of(w.p34, e) * velocity - x[e]
            pep_next += np.minimum(np.where(ahead >= 0, of(w.p32, e), of(w.p33, e)) * s[e] * ahead, 4.0)
        aep_next = np.where(origin + x >= (origin + x)[front], (PEP_MIN - aep) * of(w.p4, front), 0.0)
        s_old = s
        x = x - velocity * DT * s + DT * (1 - s)
        aep = AEP0 + aep_shift
        s = np.where(s == 1, x >= np.maximum(PEP0 + pep_shift, PEP_MIN), x > aep).astype(float)
        pep_shift, aep_shift = pep_next, aep_next
        u = (origin + x) * per_y
        most, least = np.where(s == 1, u, -inf), np.where(s == 1, u, inf)
        unstable = (most[:3].max(axis=0) + most[3:].max(axis=0) <= 0) | (
            least[:3].min(axis=0) + least[3:].min(axis=0) >= 0
        )
        if unstable.any():
            lost[ids[unstable]] = n * DT
            left = ~unstable
            ids, x, s, s_old, aep = ids[left], x[:, left], s[:, left], s_old[:, left], aep[:, left]
            pep_shift, aep_shift = pep_shift[:, left], aep_shift[:, left]
    return lost
