"""The compiled kernel of the network: Eq. 1-6 and 11 and static stability, for many starts side by side.

A block holds `LANES` starts, one per lane, and has one row of lanes for each variable of each leg.  A step applies
the same operations to every lane, without a branch and to all six legs in one pass, so that the compiler uses vector
instructions; weights and constants are tuples, whose numbers it keeps in registers.  When the first loss of a start
is known, its lane takes the next start, so that blocks stay full.  No multiplication is fused with an addition:
``tests/plain_network.py`` holds the same equations in readable form, and both agree to the last bit.

On one core of an AMD EPYC (Zen 5), 8 to 32 lanes are slower; 128 lanes are 10 % faster, but take 42 kB, more than
the L1 cache of many processors; computing one start after the other is five times slower (`make bench`).
"""

from typing import Any

import numpy as np

from hexmj.jitted import inlined, jitted, part
from hexmj.legs import MIRROR, N2, N4
from hexmj.stability import margin_of
from hexmj.tipping import pendulum_step

LANES = 64
PRINTED, UNDELAYED, SEQUENTIAL = range(3)
ABOVE, BOTH, SUM = range(3)

# Index of each leg's neighbour.  A leg without such a neighbour has its own index, and the weight is 0.
REAR = tuple(n[0] if n else d for d, n in enumerate(N2))
FRONT = tuple(n[0] if n else d for d, n in enumerate(N4))
CONTRA = MIRROR

# Indices of legs and rows are NumPy integers: numba would compile a function again for each Python integer.
L1, L2, L3, R1, R2, R3 = np.arange(6)

# Rows of a block.  Six rows per variable, one for each leg: the tip x, the states s(t) and s(t - dt), AEP(t), and
# the shifts of PEP and AEP that the next step uses.
X, S, S_OLD, AEP, PEP_SHIFT, AEP_SHIFT = np.arange(0, 36, 6)
# One row per variable: V_r(t), final V_r, number of steps to search and of steps done, step of the first loss or 0.
V, V_FINAL, STEPS, DONE, LOST = range(36, 41)
# The pendulum of `tipping`: excursion, its speed, the greatest excursion, step of the loss of dynamic stability or 0.
EXCURSION, SPEED, MOST, TIPPED = range(41, 45)
ROWS = 45

SLACK = 1e-9
"""Slope by which static stability is certain in spite of rounding errors, see `_stable`."""

# Indices into the weights `p`: six weights of each kind, one per destination.  P^2 is multiplied by AEP_0 - PEP_min.
_P1_REAR, _P1_CONTRA, _P2_REAR, _P4_FRONT = range(0, 24, 6)
_P31_FRONT, _P32_FRONT, _P33_FRONT, _P34_FRONT = range(24, 48, 6)
_P31_CONTRA, _P32_CONTRA, _P33_CONTRA, _P34_CONTRA = range(48, 72, 6)

# Indices into the constants `k`: AEP_0, PEP_0, PEP_min, dt, V_r(0), a, six origins of axes, 1 / |y| and y of six lines,
# and whether each leg stands at time 0.
_AEP0, _PEP0, _PEP_MIN, _DT, _V_START, _RATE, _ORIGIN, _PER_Y, _Y, _STANDS = 0, 1, 2, 3, 4, 5, 6, 12, 18, 24

# Indices into `rules`, the choices of `network.Order` and `network.ModelVariant`.  A choice is the length of a tuple,
# and so part of its type: numba compiles each combination separately, without branches for the other choices.
_ORDER, _FRONT_LASTS, _CONTRA_LASTS, _CAP, _STRONGEST, _FINAL = range(6)


@inlined
def _influence(d, x, s, s_old, aep, v, p, k, rules):
    """Return leg d's shifts of PEP (Delta^1 + Delta^2 + Delta^3) and AEP (Delta^4), Eq. 2-5; V_r in P^nr is `v`."""
    rear, contra, front = REAR[d], CONTRA[d], FRONT[d]
    rear1 = 0.0 if s[rear] == 1.0 else -p[_P1_REAR + d]  # Eq. 2
    contra1 = 0.0 if s[contra] == 1.0 else -p[_P1_CONTRA + d]
    pep = (rear1 if abs(rear1) > abs(contra1) else contra1) if len(rules[_STRONGEST]) else rear1 + contra1
    pep += p[_P2_REAR + d] if (s[rear] == 1.0) & (s_old[rear] == 0.0) else 0.0  # Eq. 3
    behind = p[_P31_FRONT + d] + p[_P34_FRONT + d] * v - x[front]  # Eq. 4 begins
    front3 = _capped((p[_P32_FRONT + d] if behind >= 0.0 else p[_P33_FRONT + d]) * behind, rules)
    front3 = front3 if (s[front] == 1.0) | (len(rules[_FRONT_LASTS]) == 1) else 0.0
    behind = p[_P31_CONTRA + d] + p[_P34_CONTRA + d] * v - x[contra]
    contra3 = _capped((p[_P32_CONTRA + d] if behind >= 0.0 else p[_P33_CONTRA + d]) * behind, rules)
    contra3 = contra3 if (s[contra] == 1.0) | (len(rules[_CONTRA_LASTS]) == 1) else 0.0
    pep = pep + front3 + contra3
    if len(rules[_CAP]) == SUM:
        pep -= front3 + contra3 - 4.0 if front3 + contra3 > 4.0 else 0.0  # Eq. 4 ends
    crossed = k[_ORIGIN + d] + x[d] >= k[_ORIGIN + front] + x[front]
    return pep, (k[_PEP_MIN] - aep[d]) * p[_P4_FRONT + d] if crossed else 0.0  # Eq. 5


@inlined
def _capped(shift, rules):
    """Return an influence of mechanism 3 with the limit of 4 mm of Eq. 4 that the choice ABOVE or BOTH sets."""
    if len(rules[_CAP]) != SUM:
        shift = shift if shift < 4.0 else 4.0
    if len(rules[_CAP]) == BOTH:
        shift = shift if shift > -4.0 else -4.0
    return shift


@inlined
def _move(x, s, pep_shift, aep_shift, v, k):
    """Return the tip, state and AEP of one leg after the step, Eq. 6."""
    x += -v * k[_DT] if s == 1.0 else k[_DT]
    aep = k[_AEP0] + aep_shift
    pep = k[_PEP0] + pep_shift
    pep = pep if pep > k[_PEP_MIN] else k[_PEP_MIN]
    lands = 1.0 if x > aep else 0.0
    stays = 0.0 if x < pep else 1.0
    return x, (stays if s == 1.0 else lands), aep


@inlined
def _influences(x, s, s_old, aep, v, p, k, rules):
    """Return the shifts of PEP and the shifts of AEP of all legs, Eq. 2-5."""
    pep0, aep0 = _influence(L1, x, s, s_old, aep, v, p, k, rules)
    pep1, aep1 = _influence(L2, x, s, s_old, aep, v, p, k, rules)
    pep2, aep2 = _influence(L3, x, s, s_old, aep, v, p, k, rules)
    pep3, aep3 = _influence(R1, x, s, s_old, aep, v, p, k, rules)
    pep4, aep4 = _influence(R2, x, s, s_old, aep, v, p, k, rules)
    pep5, aep5 = _influence(R3, x, s, s_old, aep, v, p, k, rules)
    return (pep0, pep1, pep2, pep3, pep4, pep5), (aep0, aep1, aep2, aep3, aep4, aep5)


@inlined
def _moves(x, s, pep_shift, aep_shift, v, k):
    """Return the tips, states and AEPs of all legs after the step, Eq. 6."""
    x0, s0, aep0 = _move(x[0], s[0], pep_shift[0], aep_shift[0], v, k)
    x1, s1, aep1 = _move(x[1], s[1], pep_shift[1], aep_shift[1], v, k)
    x2, s2, aep2 = _move(x[2], s[2], pep_shift[2], aep_shift[2], v, k)
    x3, s3, aep3 = _move(x[3], s[3], pep_shift[3], aep_shift[3], v, k)
    x4, s4, aep4 = _move(x[4], s[4], pep_shift[4], aep_shift[4], v, k)
    x5, s5, aep5 = _move(x[5], s[5], pep_shift[5], aep_shift[5], v, k)
    return (x0, x1, x2, x3, x4, x5), (s0, s1, s2, s3, s4, s5), (aep0, aep1, aep2, aep3, aep4, aep5)


@inlined
def _move_in_turn(d, x, s, s_old, aep, v, v_neutral, p, k, rules):
    """Move leg d by Eq. 2-6, after the legs before it have moved."""
    pep_shift, aep_shift = _influence(d, x, s, s_old, aep, v_neutral, p, k, rules)
    x_d, s_d, aep_d = _move(x[d], s[d], pep_shift, aep_shift, v, k)
    return _put(x, d, x_d), _put(s, d, s_d), _put(s_old, d, s[d]), _put(aep, d, aep_d)


@inlined
def _put(six, d, value):
    """Return six numbers in which the number of leg d is replaced by `value`."""
    a, b, c = (value if d == 0 else six[0]), (value if d == 1 else six[1]), (value if d == 2 else six[2])
    return a, b, c, (value if d == 3 else six[3]), (value if d == 4 else six[4]), (value if d == 5 else six[5])


@inlined
def _moves_in_turn(x, s, s_old, aep, v, v_neutral, p, k, rules):
    """Move all legs by Eq. 2-6, one after the other."""
    x, s, s_old, aep = _move_in_turn(L1, x, s, s_old, aep, v, v_neutral, p, k, rules)
    x, s, s_old, aep = _move_in_turn(L2, x, s, s_old, aep, v, v_neutral, p, k, rules)
    x, s, s_old, aep = _move_in_turn(L3, x, s, s_old, aep, v, v_neutral, p, k, rules)
    x, s, s_old, aep = _move_in_turn(R1, x, s, s_old, aep, v, v_neutral, p, k, rules)
    x, s, s_old, aep = _move_in_turn(R2, x, s, s_old, aep, v, v_neutral, p, k, rules)
    return _move_in_turn(R3, x, s, s_old, aep, v, v_neutral, p, k, rules)


@inlined
def _stable(x, s, k, slack=0.0):
    """Return whether the centre of mass lies strictly inside the support polygon, by more than `slack`.

    With u = x / |y| of the standing feet, it does if and only if feet stand on both sides, max u left + max u right
    > 0, and min u left + min u right < 0.
    """
    o, w = k[_ORIGIN:_PER_Y], k[_PER_Y:_Y]
    u0, u1, u2 = (o[0] + x[0]) * w[0], (o[1] + x[1]) * w[1], (o[2] + x[2]) * w[2]
    u3, u4, u5 = (o[3] + x[3]) * w[3], (o[4] + x[4]) * w[4], (o[5] + x[5]) * w[5]
    none = np.inf
    front = max(u0 if s[0] == 1.0 else -none, u1 if s[1] == 1.0 else -none, u2 if s[2] == 1.0 else -none)
    front += max(u3 if s[3] == 1.0 else -none, u4 if s[4] == 1.0 else -none, u5 if s[5] == 1.0 else -none)
    rear = min(u0 if s[0] == 1.0 else none, u1 if s[1] == 1.0 else none, u2 if s[2] == 1.0 else none)
    rear += min(u3 if s[3] == 1.0 else none, u4 if s[4] == 1.0 else none, u5 if s[5] == 1.0 else none)
    return (front > slack) & (rear < -slack)


@inlined
def _load(z, row, j):
    """Return the six legs' numbers of a variable in lane j; `row` is the variable's first row."""
    at = row * LANES + j
    return (z[at], z[at + LANES], z[at + 2 * LANES], z[at + 3 * LANES], z[at + 4 * LANES], z[at + 5 * LANES])


@inlined
def _store(z, row, j, six):
    at = row * LANES + j
    z[at], z[at + LANES], z[at + 2 * LANES] = six[0], six[1], six[2]
    z[at + 3 * LANES], z[at + 4 * LANES], z[at + 5 * LANES] = six[3], six[4], six[5]


@inlined
def _neutral_velocity(z, j, rules):
    """Return the V_r in the neutral position P^nr, in lane j."""
    return z[(V_FINAL if len(rules[_FINAL]) else V) * LANES + j]


@inlined
def _finish(z, j, x, s, s_old, aep, v, k):
    """Store a lane's legs after a step, note a first loss of static stability, and update V_r."""
    _store(z, X, j, x)
    _store(z, S, j, s)
    _store(z, S_OLD, j, s_old)
    _store(z, AEP, j, aep)
    n, lost = z[DONE * LANES + j] + 1.0, z[LOST * LANES + j]
    first = (not _stable(x, s, k)) & (lost == 0.0) & (n <= z[STEPS * LANES + j])
    z[LOST * LANES + j] = n if first else lost
    z[DONE * LANES + j] = n
    final = z[V_FINAL * LANES + j]
    z[V * LANES + j] = k[_V_START] + k[_RATE] * (n * k[_DT]) if v < final else final  # Eq. 11


@part
def _step_printed(z, p, k, rules):
    """Advance a block by one step, all six legs at once, PEP(t + dt) from Delta(t)."""
    for j in range(LANES):
        x, s, s_old, aep = _load(z, X, j), _load(z, S, j), _load(z, S_OLD, j), _load(z, AEP, j)
        v = z[V * LANES + j]
        v_neutral = _neutral_velocity(z, j, rules)
        x_new, s_new, aep_new = _moves(x, s, _load(z, PEP_SHIFT, j), _load(z, AEP_SHIFT, j), v, k)
        pep_shift, aep_shift = _influences(x, s, s_old, aep, v_neutral, p, k, rules)
        _store(z, PEP_SHIFT, j, pep_shift)
        _store(z, AEP_SHIFT, j, aep_shift)
        _finish(z, j, x_new, s_new, s, aep_new, v, k)


@part
def _step_undelayed(z, p, k, rules):
    """Advance a block by one step, all six legs at once, PEP(t + dt) from Delta(t + dt)."""
    for j in range(LANES):
        x, s, s_old, aep = _load(z, X, j), _load(z, S, j), _load(z, S_OLD, j), _load(z, AEP, j)
        v = z[V * LANES + j]
        v_neutral = _neutral_velocity(z, j, rules)
        pep_shift, aep_shift = _influences(x, s, s_old, aep, v_neutral, p, k, rules)
        x_new, s_new, aep_new = _moves(x, s, pep_shift, aep_shift, v, k)
        _finish(z, j, x_new, s_new, s, aep_new, v, k)


@part
def _step_sequential(z, p, k, rules):
    """Advance a block by one step, one leg after the other."""
    for j in range(LANES):
        x, s, s_old, aep = _load(z, X, j), _load(z, S, j), _load(z, S_OLD, j), _load(z, AEP, j)
        v = z[V * LANES + j]
        v_neutral = _neutral_velocity(z, j, rules)
        x, s, s_old, aep = _moves_in_turn(x, s, s_old, aep, v, v_neutral, p, k, rules)
        _finish(z, j, x, s, s_old, aep, v, k)


@part
def _step(z, order, p, k, rules):
    if len(order) == SEQUENTIAL:
        _step_sequential(z, p, k, rules)
    elif len(order) == UNDELAYED:
        _step_undelayed(z, p, k, rules)
    else:
        _step_printed(z, p, k, rules)


@part
def _begin(z, j, start, v, v_final, steps, k):
    """Put a start at time 0 into lane j: Delta = 0, AEP = AEP_0, s(-dt) = s(0)."""
    for leg in range(6):
        z[(X + leg) * LANES + j] = start[leg]
        z[(S + leg) * LANES + j] = z[(S_OLD + leg) * LANES + j] = k[_STANDS + leg]
        z[(AEP + leg) * LANES + j] = k[_AEP0]
        z[(PEP_SHIFT + leg) * LANES + j] = z[(AEP_SHIFT + leg) * LANES + j] = 0.0
    z[V * LANES + j], z[V_FINAL * LANES + j] = v, v_final
    z[STEPS * LANES + j], z[DONE * LANES + j], z[LOST * LANES + j] = steps, 0.0, 0.0
    z[EXCURSION * LANES + j] = z[SPEED * LANES + j] = z[MOST * LANES + j] = z[TIPPED * LANES + j] = 0.0


@part
def _block():
    """Return a block aligned to the cache lines; without alignment, FLSS took up to 1.4 times as long."""
    z = np.zeros(ROWS * LANES + 7)
    return z[(64 - z.ctypes.data % 64) % 64 // 8 :]


@part
def _follow_pendulums(z, pendulum, feet, stands, k):
    """Let the pendulums of a block follow a step; `feet`, (leg, 2), and `stands`, (leg,), are scratch arrays."""
    gain, height = pendulum
    for j in range(LANES):
        if not (z[TIPPED * LANES + j] == 0.0 and z[DONE * LANES + j] <= z[STEPS * LANES + j]):
            continue
        x, s, excursion = _load(z, X, j), _load(z, S, j), z[EXCURSION * LANES + j]
        if excursion == 0.0 and _stable(x, s, k, SLACK):
            continue
        for leg in range(6):
            feet[leg, 0], feet[leg, 1] = z[(X + leg) * LANES + j] + k[_ORIGIN + leg], k[_Y + leg]
            stands[leg] = z[(S + leg) * LANES + j] == 1.0
        excursion, speed = pendulum_step(margin_of(feet, stands), excursion, z[SPEED * LANES + j], gain)
        z[EXCURSION * LANES + j], z[SPEED * LANES + j] = excursion, speed
        z[MOST * LANES + j] = max(z[MOST * LANES + j], excursion)
        z[TIPPED * LANES + j] = z[DONE * LANES + j] if excursion > height else 0.0


@jitted
def first_losses(
    starts: Any, v: Any, v_final: Any, steps: Any, p: Any, k: Any, rules: Any, pendulum: Any, losses: Any
) -> None:
    """Write what each start loses within its `steps` to `losses`, the arrays of a `tipping.Losses`.

    `starts` is (start, leg), `v`, `v_final` and `steps` are (start,); `p`, `k` and `rules` are the parts of
    `network.Constants`: weights, constants and choices. Walks end at the loss of dynamic stability, or, if the gain of
    the pendulum is 0, at the first loss of static stability.
    """
    z, start_in = _block(), np.full(LANES, -1)  # index of the start in each lane; -1 if the lane is empty
    feet, stands = np.empty((6, 2)), np.empty(6, np.bool_)
    static, dynamic, most = losses
    end = TIPPED if pendulum[0] > 0.0 else LOST
    following = undecided = 0
    while True:
        if undecided == 0 or (undecided < LANES and following < len(starts)):
            for j in range(LANES):
                if not _undecided(z, j, end) and start_in[j] >= 0:
                    i = start_in[j]
                    static[i], dynamic[i] = z[LOST * LANES + j], z[TIPPED * LANES + j]
                    most[i] = z[MOST * LANES + j]
                    start_in[j] = -1
                if start_in[j] < 0 and following < len(starts):
                    _begin(z, j, starts[following], v[following], v_final[following], steps[following], k)
                    start_in[j] = following
                    following += 1
        if start_in.max() < 0:
            return
        _step(z, rules[_ORDER], p, k, rules)
        if end == TIPPED:
            _follow_pendulums(z, pendulum, feet, stands, k)
        undecided = 0
        for j in range(LANES):
            undecided += _undecided(z, j, end)


@inlined
def _undecided(z, j, end):
    return (z[end * LANES + j] == 0.0) & (z[DONE * LANES + j] < z[STEPS * LANES + j])


@jitted
def begin_blocks(blocks: Any, starts: Any, v: Any, v_final: Any, k: Any) -> None:
    """Write every start at time 0 to `blocks`, (block, row of lanes); spare lanes at the end repeat the last start."""
    for i in range(len(blocks) * LANES):
        n = min(i, len(starts) - 1)
        _begin(blocks[i // LANES], i % LANES, starts[n], v[n], v_final[n], 0.0, k)


@jitted
def record(blocks: Any, begin: int, end: int, p: Any, k: Any, rules: Any, velocity: Any, x: Any, stance: Any) -> None:
    """Advance blocks `begin` to `end`; write each step's V_r, (step, start), tips and stance, (step, start, leg)."""
    steps, starts = velocity.shape
    for b in range(begin, end):
        z = blocks[b]
        first = b * LANES
        lanes = min(LANES, starts - first)
        for n in range(steps):
            for j in range(lanes):
                velocity[n, first + j] = z[V * LANES + j]
            _step(z, rules[_ORDER], p, k, rules)
            for j in range(lanes):
                for leg in range(6):
                    x[n, first + j, leg] = z[(X + leg) * LANES + j]
                    stance[n, first + j, leg] = z[(S + leg) * LANES + j] == 1.0


@jitted
def lose(blocks: Any, begin: int, end: int, unseen: int, seen: int, p: Any, k: Any, rules: Any, pendulum: Any) -> None:
    """Advance blocks `begin` to `end`; their rows `LOST` then hold the first losses after the `unseen` steps.

    If the gain of the pendulum is above 0, `TIPPED` and `MOST` hold the losses of dynamic stability and the excursions.
    """
    feet, stands = np.empty((6, 2)), np.empty(6, np.bool_)
    for b in range(begin, end):
        z = blocks[b]
        for n in range(unseen + seen):
            if n == unseen:
                z[STEPS * LANES : (STEPS + 1) * LANES] = z[DONE * LANES] + seen  # losses count from here
            _step(z, rules[_ORDER], p, k, rules)
            if n >= unseen and pendulum[0] > 0.0:
                _follow_pendulums(z, pendulum, feet, stands, k)
