"""The paper's network in its readable form: one start, one leg, one equation at a time.

Slow on purpose.  It reads the general weights P_{d,e} and the neighbour sets as the paper prints them
and knows nothing of lanes and blocks; the compiled network must agree with it to the last bit.
"""

from dataclasses import dataclass
from math import inf

from hexmj.controllers.cruse1998 import ModelVariant, Order, Weights
from hexmj.legs import N1, N2, N3, N4
from hexmj.timing import Acceleration, Stride

LEGS = range(6)
PRINTED = ModelVariant()


@dataclass
class State:
    """All six legs at time t."""

    x: list[float]
    s: list[int]
    s_old: list[int]
    aep: list[float]
    pep_shift: list[float]
    aep_shift: list[float]
    v: float
    v_final: float


def begin(start: list[float], velocity: float, stride: Stride, acceleration: Acceleration | None) -> State:
    v = acceleration.start if acceleration else velocity
    return State(list(start), [1] * 6, [1] * 6, [stride.aep0] * 6, [0.0] * 6, [0.0] * 6, v, velocity)


def mechanism_1(d: int, state: State, p: Weights, model_variant: ModelVariant) -> float:
    """Of all legs in N^1; of equally strong ones the last counts."""
    shifts = [(state.s[e] - 1) * p.p1[d, e] for e in N1[d]]
    return sum(shifts) if model_variant.rear == "sum" else max(reversed(shifts), key=abs)


def mechanism_2(d: int, e: int, state: State, p: Weights, stride: Stride) -> float:
    return (stride.aep0 - stride.pep_min) * p.p2[d, e] if state.s[e] == 1 and state.s_old[e] == 0 else 0.0


def mechanism_3(d: int, e: int, state: State, p: Weights, model_variant: ModelVariant) -> float:
    neutral = p.p31[d, e] + p.p34[d, e] * (state.v if model_variant.neutral == "present" else state.v_final)
    weight = p.p32[d, e] if state.x[e] <= neutral else p.p33[d, e]
    lasting = model_variant.contralateral if abs(d - e) == 3 else model_variant.ipsilateral
    shift = weight * (1 if lasting == "lasting" else state.s[e]) * (neutral - state.x[e])
    if model_variant.cap == "sum":
        return shift
    return min(shift, 4.0) if model_variant.cap == "above" else max(min(shift, 4.0), -4.0)


def mechanism_4(d: int, e: int, state: State, p: Weights, stride: Stride) -> float:
    origin = stride.geometry.origin
    crossed = origin[d] + state.x[d] >= origin[e] + state.x[e]
    return (stride.pep_min - state.aep[d]) * p.p4[d, e] if crossed else 0.0


def influences(d: int, state: State, p: Weights, stride: Stride, model_variant: ModelVariant) -> tuple[float, float]:
    """The shifts of PEP and AEP of leg d, from the states of its neighbours."""
    pep = mechanism_1(d, state, p, model_variant)
    for e in N2[d]:
        pep += mechanism_2(d, e, state, p, stride)
    third = [mechanism_3(d, e, state, p, model_variant) for e in N3[d]]
    for shift in third:
        pep += shift
    if model_variant.cap == "sum":
        pep -= max(sum(third) - 4.0, 0.0)
    return pep, sum(mechanism_4(d, e, state, p, stride) for e in N4[d])


def move(d: int, state: State, pep_shift: float, aep_shift: float, stride: Stride) -> None:
    """Eq. 6 for leg d."""
    dt, s = stride.dt, state.s[d]
    state.x[d] = state.x[d] - state.v * dt * s + dt * (1 - s)
    state.aep[d] = stride.aep0 + aep_shift
    pep = max(stride.pep_min, stride.pep0 + pep_shift)
    state.s_old[d] = s
    if s == 0 and state.x[d] > state.aep[d]:
        state.s[d] = 1
    if s == 1 and state.x[d] < pep:
        state.s[d] = 0


def step(state: State, p: Weights, order: Order, stride: Stride, model_variant: ModelVariant) -> None:
    """One step of all six legs in the order of updates that is asked for."""
    if order == "sequential":
        for d in LEGS:
            move(d, state, *influences(d, state, p, stride, model_variant), stride)
        return
    following = [influences(d, state, p, stride, model_variant) for d in LEGS]
    used = following if order == "undelayed" else list(zip(state.pep_shift, state.aep_shift, strict=True))
    for d in LEGS:
        move(d, state, *used[d], stride)
    state.pep_shift, state.aep_shift = ([f[i] for f in following] for i in (0, 1))


def walk(
    start: list[float],
    p: Weights,
    velocity: float,
    steps: int,
    stride: Stride,
    order: Order = "printed",
    acceleration: Acceleration | None = None,
    model_variant: ModelVariant = PRINTED,
) -> tuple[list[list[float]], list[list[int]], list[float]]:
    """Tips and states after each step, (step, leg), and V_r during it, (step,)."""
    state = begin(start, velocity, stride, acceleration)
    tips, states, velocities = [], [], []
    for n in range(1, steps + 1):
        velocities.append(state.v)
        step(state, p, order, stride, model_variant)
        tips.append(list(state.x))
        states.append(list(state.s))
        if acceleration:  # Eq. 11
            accelerated = acceleration.start + acceleration.rate * (n * stride.dt)
            state.v = accelerated if state.v < velocity else velocity
    return tips, states, velocities


def stable(x: list[float], s: list[int], stride: Stride) -> bool:
    """Strict static stability in closed form, by u = x / |y| of the standing feet on either side."""
    geometry = stride.geometry
    u = [(o + x_d) * (1 / abs(y)) for o, x_d, y in zip(geometry.origin, x, geometry.y, strict=True)]
    left = [u[d] for d in LEGS if s[d] and geometry.y[d] > 0]
    right = [u[d] for d in LEGS if s[d] and geometry.y[d] < 0]
    return bool(left and right) and max(left) + max(right) > 0 and min(left) + min(right) < 0


def first_loss(start: list[float], p: Weights, velocity: float, steps: int, stride: Stride) -> float:
    """Time of the first loss of static stability at constant velocity, inf where there is none."""
    state = begin(start, velocity, stride, None)
    for n in range(1, steps + 1):
        step(state, p, "printed", stride, PRINTED)
        if not stable(state.x, state.s, stride):
            return n * stride.dt
    return inf
