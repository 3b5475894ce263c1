"""The coordination network of 1998 as a controller: Eq. 1-6 and 11 of the paper, for many starts at once.

A step computes the legs at t + dt from the legs at t and V_r(t). We let a walk begin with Delta(0) = 0,
AEP(0) = AEP_0 and s(-dt) = s(0), where the paper is silent. The module `kernel` holds the compiled equations,
``tests/plain_network.py`` their readable form.
"""

from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Literal, get_args, get_type_hints

import numpy as np

import hexmj.controllers.cruse1998.kernel as kernel
from hexmj.controllers.cruse1998.weights import NEIGHBOURS, PLACES, AnyWeights, Symmetric, Weights, general
from hexmj.controllers.planning import planned_dynamic_losses, planned_losses
from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.starts import checked_starts, checked_velocities
from hexmj.threads import run_blocks, thread_count
from hexmj.timing import Acceleration, Stride
from hexmj.tipping import STATIC, Losses, Pendulum
from hexmj.validate import choice, short, whole
from hexmj.walks import PlannedWalk

Order = Literal["printed", "undelayed", "sequential"]
"""Orders in which the legs are updated, see `Cruse1998.order`; the kernel numbers them in this sequence."""

Constants = tuple[tuple[float, ...], tuple[float, ...], tuple[tuple[int, ...], ...]]
"""Arguments `p`, `k` and `rules` of the kernel: weights, constants, choices. The choices are the order of updates and
the fields of a model variant; each is a tuple whose length is the number of the chosen value."""

AT_ONCE = 200_000_000
"""Maximum of steps times starts in one call of the kernel: about two seconds, in which Ctrl-C has no effect."""


@dataclass(frozen=True)
class ModelVariant:
    """An interpretation of the paper's Section 2, of which text and equations allow more than one network.

    The order in which the legs are updated is a separate field, `Cruse1998.order`.
    """

    ipsilateral: Literal["standing", "lasting"] = "standing"
    """When the anterior leg acts on the PEP (Eq. 4). 'standing': while it stands (factor s_e(t)). 'lasting': always, by
    the text: 'the value of the influence depends on the position of the distal point of the influencing leg'."""
    contralateral: Literal["standing", "lasting"] = "standing"
    """When the contralateral leg acts by mechanism 3: while it stands ('standing') or always ('lasting')."""
    cap: Literal["above", "both", "sum"] = "above"
    """What the 4 mm of Eq. 4 limit. 'above': each influence to at most 4 mm, as printed. 'both': each to -4 to 4 mm.
    'sum': the sum over N^3 ('the influences of the anterior and contralateral legs') to at most 4 mm."""
    rear: Literal["sum", "strongest"] = "sum"
    """How mechanism 1 combines two legs that act ('the effects ... come from the ipsilateral rear leg (if it exists)
    and the contralateral one'). 'sum': their sum, as in Eq. 6. 'strongest': only the larger of the two."""
    neutral: Literal["present", "final"] = "present"
    """V_r that determines the neutral position P^nr while accelerating: 'present' V_r (Eq. 6) or 'final' V_r*."""

    def __post_init__(self) -> None:
        for name, hint in get_type_hints(ModelVariant).items():
            choice(name, getattr(self, name), get_args(hint))


MODEL_VARIANTS = {"printed": ModelVariant(), "lasting": ModelVariant(ipsilateral="lasting")}
"""Model variants by name: 'printed', and 'lasting', in which the anterior leg also acts while it protracts."""


def named_variant(name: str) -> ModelVariant:
    """Return a model variant by its name; raise InputError if there is no such name."""
    return MODEL_VARIANTS[choice("model_variant", name, MODEL_VARIANTS)]


def variant_name(model_variant: ModelVariant) -> str:
    """Return a model variant's name, or the choices that differ from 'printed', such as 'cap sum, neutral final'."""
    for name, named in MODEL_VARIANTS.items():
        if named == model_variant:
            return name
    chosen = {field.name: getattr(model_variant, field.name) for field in fields(ModelVariant)}
    return ", ".join(f"{name} {value}" for name, value in chosen.items() if value != getattr(ModelVariant, name))


@dataclass(frozen=True)
class Cruse1998:
    """The coordination network of Cymbalyuk, Borisyuk, Mueller-Wilm and Cruse (Neural Networks 11, 1998)."""

    weights: AnyWeights
    """Coupling weights."""
    order: Order = "printed"
    """Order of updates. 'printed': all legs at once, PEP(t+dt) from Delta(t) as in Eq. 6. 'undelayed': all at once,
    from Delta(t+dt). 'sequential': as undelayed, but leg after leg, each from the new states of the legs before it."""
    name: str = "cruse1998"
    """Name of the weight set."""
    model_variant: ModelVariant = field(default_factory=ModelVariant)
    """Interpretation of the rules that the paper leaves open."""

    stands: ClassVar[tuple[float, ...]] = (1.0,) * 6
    """State s(0) of each leg: 1 if it stands at time 0, 0 if it swings."""

    def __post_init__(self) -> None:
        choice("order", self.order, get_args(Order))
        if not isinstance(self.weights, AnyWeights):
            raise InputError(f"weights = {short(self.weights)}; expected an instance of Symmetric or Weights")

    @property
    def mirrored(self) -> bool:
        """Whether mirrored starts give mirrored walks: the legs move at once, and both sides have equal weights."""
        if self.order == "sequential" or 0.0 in self.stands:
            return False
        matrices = [getattr(general(self.weights), kind) for kind in NEIGHBOURS]
        return all(np.array_equal(w, w[MIRROR, :][:, MIRROR]) for w in matrices)

    def without(self, mechanism: int) -> "Cruse1998":
        """Return the network without one of the mechanisms 1 to 4; its name ends with ``-without-N``.

        Raises:
            InputError: there is no such mechanism, or the weight set does not use it.
        """
        mechanism = whole("mechanism", mechanism, 1, 4)
        return self._having(mechanism, 0.0, f"{self.name}-without-{mechanism}")

    def having(self, mechanism: int) -> "Cruse1998":
        """Return the network with mechanism 2 or 4 switched on; its name ends with ``-with-N``.

        Raises:
            InputError: the mechanism is not 2 or 4, or is on already.
        """
        if mechanism not in (2, 4):
            raise InputError(f"mechanism = {mechanism}; only mechanisms 2 and 4 can be switched on")
        return self._having(mechanism, 1.0, f"{self.name}-with-{mechanism}")

    def _having(self, mechanism: int, value: float, name: str) -> "Cruse1998":
        """Return the network called `name`, in which all weights of a mechanism have the given value."""
        kinds = [kind for kind in NEIGHBOURS if kind[1] == str(mechanism)]
        old: Any = self.weights
        if isinstance(old, Symmetric):
            changed = replace(old, **{key: value for key in asdict(old) if key.partition("_")[0] in kinds})
        else:
            changed = Weights.of({(k, at): value if k in kinds else getattr(old, k)[at] for k, at in PLACES.values()})
        if np.array_equal(general(changed).to_vector(), general(old).to_vector()):
            raise InputError(f"mechanism {mechanism} of {self.name} is already {'on' if value else 'off'}")
        return replace(self, weights=changed, name=name)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> "NetworkPlan":
        """See `protocol.Controller.begin`."""
        x = checked_starts(starts, stride)
        final = checked_velocities(velocity, len(x), acceleration)
        slow = np.full(len(x), acceleration.start) if acceleration else final
        return NetworkPlan(x, stride, self._constants(stride, acceleration), slow, slow, final, threads)

    def begin_at_speed(self, starts, velocity, stride, acceleration=None, threads=None) -> "NetworkPlan":
        """See `protocol.SteerableController.begin_at_speed`."""
        plan = self.begin(starts, velocity, stride, acceleration, threads)
        return replace(plan, first=plan.final)

    def _constants(self, stride: Stride, acceleration: Acceleration | None) -> Constants:
        """Return the arguments `p`, `k` and `rules` of the kernel."""
        w, d, g = general(self.weights), np.arange(6), stride.geometry
        span = stride.aep0 - stride.pep_min
        table = [(w.p1, kernel.REAR), (w.p1, kernel.CONTRA), (span * w.p2, kernel.REAR), (w.p4, kernel.FRONT)]
        table += [(p, source) for source in (kernel.FRONT, kernel.CONTRA) for p in (w.p31, w.p32, w.p33, w.p34)]
        p = np.concatenate([matrix[d, source] for matrix, source in table])
        eq11 = (acceleration.start, acceleration.rate) if acceleration else (0.0, 0.0)
        lines = *g.origin, *(1 / np.abs(g.y)), *g.y
        k = np.array([stride.aep0, stride.pep0, stride.pep_min, stride.dt, *eq11, *lines, *self.stands])
        chosen: list[tuple[Any, str]] = [(Order, self.order)]
        chosen += [(hint, getattr(self.model_variant, name)) for name, hint in get_type_hints(ModelVariant).items()]
        rules = tuple((0,) * get_args(names).index(value) for names, value in chosen)
        return tuple(p.tolist()), tuple(k.tolist()), rules


@dataclass(frozen=True)
class TripodLifted(Cruse1998):
    """The network with the legs L1, R2 and L3 in swing at time 0."""

    stands = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)


@dataclass(eq=False)
class NetworkPlan:
    """A `protocol.SteerablePlan`: the network with many starts, advanced step by step."""

    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    constants: Constants
    """Arguments `p`, `k` and `rules` of the kernel."""
    first: np.ndarray
    """(start,) V_r at time 0."""
    slow: np.ndarray
    """(start,) V_r(0) of the acceleration; without an acceleration, the final V_r."""
    final: np.ndarray
    """(start,) final V_r."""
    threads: int | None = None
    """Number of threads, by default one per core."""
    done: int = 0
    """Steps planned so far."""

    @cached_property
    def _blocks(self) -> np.ndarray:
        """State of all starts in the kernel, (block, row of lanes); at first the state at time 0."""
        blocks = np.empty((-(-len(self.starts) // kernel.LANES), kernel.ROWS * kernel.LANES))
        kernel.begin_blocks(blocks, self.starts, self.first, self.final, self.constants[1])
        return blocks

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next `steps` steps of the walk."""
        shape = (steps, len(self.starts))
        velocity, x, stance = np.empty(shape), np.empty((*shape, 6)), np.empty((*shape, 6), dtype=bool)

        def work(begin: int, end: int) -> None:
            kernel.record(self._blocks, begin, end, *self.constants, velocity, x, stance)

        if len(self._blocks) == 1:
            work(0, 1)
        else:
            run_blocks(work, len(self._blocks), 1, self.threads)
        self.done += steps
        time = np.arange(self.done - steps + 1, self.done + 1) * self.stride.dt
        geometry = self.stride.geometry
        y, aep, height = (np.broadcast_to(value, x.shape) for value in (geometry.y, self.stride.aep0, np.nan))
        return PlannedWalk(time, velocity, x, y, stance, geometry, aep=aep, height=height)

    def first_losses(self, steps: np.ndarray) -> np.ndarray:
        """See `protocol.Plan`; the call keeps only the present state of each walk in memory."""
        if "_blocks" in vars(self):
            return planned_losses(self, steps, self.threads)
        return self._losses(steps, STATIC).static

    def first_dynamic_losses(self, steps: np.ndarray, pendulum: Pendulum) -> Losses:
        """See `protocol.Plan`."""
        if "_blocks" in vars(self):
            return planned_dynamic_losses(self, steps, pendulum, self.threads)
        return self._losses(steps, pendulum)

    def _losses(self, steps: np.ndarray, pendulum: Pendulum) -> Losses:
        losses, size = Losses.none(len(steps)), len(steps)
        block = max(8 * kernel.LANES, -(-size // (4 * thread_count(self.threads))))
        block = max(kernel.LANES, min(block, AT_ONCE // int(max(1, steps.max(initial=0)))))

        def work(begin: int, end: int) -> None:
            part = slice(begin, end)
            walks = self.starts[part], self.first[part], self.final[part], steps[part]
            kernel.first_losses(*walks, *self.constants, tuple(pendulum), tuple(column[part] for column in losses))

        run_blocks(work, size, block, self.threads)
        return losses

    def losses_after(self, unseen: int, seen: int, pendulum: Pendulum = STATIC) -> Losses:
        """Advance by `unseen` steps, then by `seen` steps, and return the first losses within the `seen` steps.

        Steps are counted from time 0. Dynamic stability is followed if the gain of the pendulum is above 0.
        """

        def work(begin: int, end: int) -> None:
            kernel.lose(self._blocks, begin, end, unseen, seen, *self.constants, tuple(pendulum))

        run_blocks(work, len(self._blocks), 1, self.threads)
        self.done += unseen + seen
        static, dynamic, most = (self._read(row, 1)[:, 0] for row in (kernel.LOST, kernel.TIPPED, kernel.MOST))
        return Losses(static.astype(int), dynamic.astype(int), most)

    @property
    def tips(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._read(kernel.X)

    @property
    def standing(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._read(kernel.S) == 1.0

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._write(kernel.X, tips)
        self._write(kernel.S, standing)

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        stands = np.array(self.constants[1][-6:])
        legs = {kernel.X: tips, kernel.S: stands, kernel.S_OLD: stands, kernel.AEP: self.stride.aep0}
        for row, values in (legs | {kernel.PEP_SHIFT: 0.0, kernel.AEP_SHIFT: 0.0}).items():
            self._write(row, np.where(which[:, None], values, self._read(row)))
        self.slow_down(which)

    def set_velocity(self, velocity: np.ndarray) -> None:
        """See `protocol.Plan`."""
        for row in (kernel.V, kernel.V_FINAL):
            self._write(row, velocity[:, None], 1)
        self.slow = self.final = velocity

    def slow_down(self, which: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        for row, values in {kernel.V: self.slow, kernel.DONE: 0.0}.items():
            self._write(row, np.where(which, values, self._read(row, 1).T).T, 1)

    def _read(self, row: int | np.integer, rows: int = 6) -> np.ndarray:
        """Return `rows` rows of the state from `row` on, (start, row): six for a variable of the legs, else one."""
        return self._rows(row, rows).transpose(0, 2, 1).reshape(-1, rows)[: len(self.starts)]

    def _write(self, row: int | np.integer, values: np.ndarray, rows: int = 6) -> None:
        padded = np.concatenate([values, np.repeat(values[-1:], -len(values) % kernel.LANES, axis=0)])
        self._rows(row, rows)[:] = padded.reshape(-1, kernel.LANES, rows).transpose(0, 2, 1)

    def _rows(self, row: int | np.integer, rows: int) -> np.ndarray:
        return self._blocks.reshape(len(self._blocks), kernel.ROWS, kernel.LANES)[:, row : row + rows]
