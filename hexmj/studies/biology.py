"""The simulated insect compared with real insects: forces, torques, gait, posture and work, with literature sources.

The ranges of real insects come from `SOURCES`, which also say how verbal statements became numbers; NaN is unknown.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from hexmj.controllers.planning import check_velocities
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.errors import InputError
from hexmj.io import attributes, markdown_table
from hexmj.measures.figures import caption
from hexmj.measures.study import Study
from hexmj.measures.tables import WalkSettings, settings
from hexmj.phases import unrolled
from hexmj.plotting import CURVE, LEGEND, SERIES, head, picture, tidy
from hexmj.studies.quantities import JOINTS, PHASES, SEGMENTS, UNITS, quantity_table
from hexmj.sweep import Cell
from hexmj.validate import whole

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Verdict = Literal["within", "below", "above", "no figure found", "none measured"]

SOURCES = {
    "motion capture": "one adult female Carausius morosus, public data of Theunissen and Duerr: phases, way of a step,"
    " and swings that last 0.10 to 0.16 of the period and 0.14 to 0.17 s, from which period and duty factor follow;"
    " coxae 'about' 12, 10, 8 mm high, read as 1 mm more or less",
    "Graham 1983": "J. exp. Biol. 104, 129, Introduction: in Carausius the least velocity of a leg's cycle is 'usually"
    " close to zero', read as at most a tenth of the mean",
    "Full et al. 1991": "Full, Blickhan, Ting, J. exp. Biol. 158, 369, Summary: the cockroach Blaberus runs; first legs"
    " brake, third legs drive, second do both, vertical peaks are equal, forces point to the coxae",
    "Dallmann et al. 2016": "Dallmann, Duerr, Schmitz, Proc. R. Soc. B 283, 20151708, abstract: Carausius is driven by"
    " depression torques about the coxa-trochanter joint, read as more than half of the work",
    "Zill et al. 2018": "Zill, Dallmann, Bueschges, Chaudhry, Schmitz, J. Neurophysiol. 120, 1807, abstract: forces in"
    " the course of joint torques of freely walking stick insects; the coxa-trochanter's stands in Szczecinski's code"
    " (nss36/campaniformSensillaModeling, CTrTorqueWaveform.csv), scaled, of no named leg: 0.784 s from zero to zero,"
    " read as a stance, past half its peak from 0.132 to 0.710 s, greatest at 0.432 s",
    "Full et al. 1990": "Full, Zuccarello, Tullis, J. exp. Biol. 150, 233, abstract: 4.6 to 8.5 ml oxygen / g / km of a"
    " beetle, a cricket and a cockroach, at 20.1 J/ml; metabolic, so an upper bound",
    "Full, Tu 1990": "J. exp. Biol. 148, 129, abstract: Blaberus at 80 to 660 mm/s",
    "not read": "measured in walking Carausius by Cruse 1976 and Dallmann et al. 2016, whose figures we have not seen",
    "": "",
}
"""Short name of a source -> reference, what it reports, and how that is converted to a range."""

ANY = math.inf
"""Bound of a range of which only the sign is known, for example 0 to `ANY`."""

STEP = 16.0, 20.0  # lowest and highest distance that a foot moves back relative to the body in a stance [mm]
SWING_SHARE, SWING_REST = (0.10, 0.16), (0.14, 0.17)  # swing duration: fraction of the period, and time [s]
SEEN_PHASES = {22.0: (0.60, 0.69), 31.0: (0.54, 0.61), 38.0: (0.50, 0.53)}  # speed [mm/s] -> ipsilateral phases
COXAE = {"front": 12.0, "middle": 10.0, "hind": 8.0}  # height of the coxae [mm]
ABOUT, APART = 1.0, 28.5  # tolerance of the heights in COXAE, and distance from front to hind coxae [mm]
OXYGEN = 20.1  # energy from oxygen [J/ml]
STANCE = 0.784  # duration of the stance in Zill et al. 2018 [s]
PAST, PAST_HALF = "coxa-trochanter torque past half its peak,", {"from": 13.2 / STANCE, "until": 71.0 / STANCE}  # %

SPEED = 24.0
"""Default speed at which a quantity is compared [mm/s]: V_r = 0.3 at V_p = 80 mm/s."""


@dataclass(frozen=True)
class Animal:
    """The range of a quantity in real insects, `low` to `high`; NaN if no number was found in the literature."""

    quantity: str
    """Name of the quantity, a key of `quantities.UNITS`."""
    low: float = math.nan
    high: float = math.nan
    source: str = ""
    """Source of the range, a key of `SOURCES`."""
    speed: float = SPEED
    """Speed at which the simulated insect is measured [mm/s]."""
    depends: bool = False
    """Whether the animals' range holds at this speed only."""
    built_in: bool = False
    """Whether the model's body or V_p was chosen to match this range, so that agreement is no evidence."""

    def verdict(self, value: float) -> Verdict:
        """Compare a mean of the simulated insect, NaN if no start has a value, with the animals' range."""
        if math.isnan(self.low) or math.isnan(value):
            return "no figure found" if math.isnan(self.low) else "none measured"
        return "below" if value < self.low else "above" if value > self.high else "within"


def timing(speed: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges of the period [s] and of the duty factor at a speed [mm/s]; a stance lasts `STEP` / speed."""
    (short, long), (share, most), (rest, slowest) = ([x / speed for x in STEP], SWING_SHARE, SWING_REST)
    period = (short + rest) / (1.0 - share), (long + slowest) / (1.0 - most)
    duty = short * (1.0 - most) / (short + slowest), long * (1.0 - share) / (long + rest)
    return period, duty


def _each(name: str, low: float = math.nan, high: float = math.nan, source: str = "") -> list[Animal]:
    """Return a row for front, middle and hind legs, with the same range."""
    return [Animal(f"{name}, {segment}", low, high, source) for segment in SEGMENTS]


_SEEN = "motion capture"
_SLOPES = [math.degrees(math.atan2(COXAE["front"] - COXAE["hind"] + off, APART)) for off in (-2 * ABOUT, 2 * ABOUT)]

ANIMALS = (
    *_each("vertical impulse", source="not read"),
    Animal("fore-aft impulse, front", -ANY, 0.0, "Full et al. 1991"),
    Animal("fore-aft impulse, middle", source="Full et al. 1991"),
    Animal("fore-aft impulse, hind", 0.0, ANY, "Full et al. 1991"),
    *_each("inward impulse", 0.0, ANY, "Full et al. 1991"),
    *_each("vertical peak of a leg", source="not read"),
    Animal("vertical peaks: greatest over least", 1.0, 1.0, "Full et al. 1991"),
    *(row for joint in JOINTS for row in _each(f"{joint} torque", source="not read")),
    *(row for end, at in PAST_HALF.items() for row in _each(f"{PAST} {end}", at, at, "Zill et al. 2018")),
    Animal("work of standing legs at the coxa-trochanter", 50.0, 100.0, "Dallmann et al. 2016"),
    *(Animal("phase, ipsilateral", *seen, _SEEN, speed, depends=True) for speed, seen in SEEN_PHASES.items()),
    *(Animal("phase, contralateral", 0.56, 0.63, _SEEN, speed, depends=True) for speed in SEEN_PHASES),
    *(Animal("duty factor", *timing(speed)[1], _SEEN, speed, depends=True) for speed in SEEN_PHASES),
    *(Animal("period", *timing(speed)[0], _SEEN, speed, depends=True) for speed in SEEN_PHASES),
    Animal("way of a standing foot", *STEP, _SEEN),
    *(Animal(f"height of the coxae, {pair}", h - ABOUT, h + ABOUT, _SEEN, built_in=True) for pair, h in COXAE.items()),
    Animal("pitch of the thorax", min(_SLOPES), max(_SLOPES), _SEEN, built_in=True),
    Animal("ripple: least over mean speed", 0.0, 0.1, "Graham 1983"),
    Animal("cost of transport, positive work"),
    Animal("cost of transport, all work"),
    Animal("positive work of the joints", 4.6 * OXYGEN, 8.5 * OXYGEN, "Full et al. 1990"),
    Animal("work on the centre of mass", 0.9, 0.9, "Full, Tu 1990"),
)
"""All rows of the table: quantities, some of them at several speeds, with their ranges in real insects."""

SPEEDS = tuple(sorted({row.speed for row in ANIMALS}))
"""Speeds at which the simulated insect walks [mm/s]."""

MEASURED = 3
"""Periods of a single leg at the end of a walk in which whole strides are measured."""

FIELDS = {"quantity": "name", "speed": "at", "low": "animal_low", "high": "animal_high"}
"""Field of `Animal` -> its name in the result, where they differ."""

HEADS = ("quantity", "ours (95 %)", "insects", "verdict on the mean", "source")
"""Column headings of the table."""

OURS: dict[str, Any] = CURVE | {"color": SERIES[0]["color"]}
INSECTS = "0.6"
"""Colour of the ranges of real insects; `OURS` is the style of the simulated insect."""

OVER_SPEED = {
    "phase, ipsilateral": "phase of neighbouring legs on a side",
    "duty factor": "duty factor: share of a period in stance",
    "period": "period of a stride [s]",
    "ripple: least over mean speed": "lowest over mean speed of the trunk",
}
"""Quantity drawn over speed -> label of its axis."""

BARS = {
    "force on both legs of a pair [% of the weight]": ("vertical impulse", "fore-aft impulse", "inward impulse"),
    "torque of a standing leg [mN mm]": tuple(f"{joint} torque" for joint in JOINTS),
}
"""Label of an axis -> quantities whose bars stand side by side, for each pair of legs."""


@dataclass(frozen=True)
class Biology(Study):
    """Physical walks from the same starts at every speed at which real insects were measured."""

    controller: Controller
    """Controller that plans the walks."""
    periods: int = 30
    """Number of periods of a single leg that each start walks; the last three are measured."""
    n_starts: int = field(default=20, kw_only=True)

    hidden: ClassVar = ("grasp", "ground", "ground_height", "ground_at", "ground_length", "ground_seed")
    """Conditions without an option of the command."""

    def __post_init__(self) -> None:
        settings_of(self.controller)  # raises InputError now rather than after the computation
        whole("periods", self.periods, MEASURED + 1, 1000)
        if not max(SPEEDS) < self.conditions.vp:
            raise InputError(f"vp = {self.conditions.vp}; expected above {max(SPEEDS):g} mm/s, the fastest walk")
        super().__post_init__()

    @property
    def velocities(self) -> list[float]:
        """V_r = speed / V_p at each speed of `SPEEDS`."""
        return np.divide(SPEEDS, self.conditions.vp).tolist()

    def cells(self) -> list[Cell]:
        """Return a cell for each of the `SPEEDS`, computed by `quantity_table`."""
        check_velocities(self.controller, self.velocities, self.stride)
        cells = []
        for speed, velocity in zip(SPEEDS, self.velocities, strict=True):
            period = float(self.stride.periods(velocity))
            same = self.n_starts, self.seed, self.conditions, self.stride
            walks = WalkSettings(self.controller, velocity, self.periods * period, *same)
            own = {"walks": walks, "measured": MEASURED * period}
            cells.append(Cell(f"{speed:g}-mm-s", quantity_table, own, 1 / velocity))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the quantities of the simulated insect beside the ranges of real insects.

        Returns:
            Over (speed, quantity, start): `value`, NaN where a start fell or made no whole stride. Over row, one for
            each of `ANIMALS`: `name`, `unit`, the speed `at` which it is compared and whether its range `depends` on
            the speed; the `mean` over the starts with its 95 % interval `low`, `high`; the range `animal_low`,
            `animal_high` and its `source`; the `verdict` on the mean; whether the range was `built_in` to the body;
            and the number of starts that `walked` whole strides.
        """
        import xarray as xr

        table = xr.concat(list(data), "speed").assign_coords(speed=("speed", list(SPEEDS), {"units": "mm/s"}))
        values = [table.value.sel(speed=row.speed, quantity=row.quantity).values for row in ANIMALS]
        ours = [_mean(starts, row.quantity) for starts, row in zip(values, ANIMALS, strict=True)]
        columns = {
            "unit": [UNITS[row.quantity] for row in ANIMALS],
            **{FIELDS.get(name, name): [getattr(row, name) for row in ANIMALS] for name in vars(ANIMALS[0])},
            **dict(zip(("mean", "low", "high"), np.transpose(ours), strict=True)),
            "verdict": [row.verdict(mean) for row, (mean, _, _) in zip(ANIMALS, ours, strict=True)],
            "walked": [np.count_nonzero(np.isfinite(starts)) for starts in values],
        }
        units = dict.fromkeys(("mean", "low", "high", "animal_low", "animal_high"), "of the row") | {"at": "mm/s"}
        rows = {name: ("row", column, {"units": units.get(name, "1")}) for name, column in columns.items()}
        walks = f"{self.periods} periods", self.n_starts, self.seed, self.stride, None
        made = {"study": "biology"} | settings({self.controller.name: self.controller}, *walks)
        made |= {"periods": self.periods, "speeds": list(SPEEDS), "conditions": self.conditions.settings()}
        return table.assign(rows).assign_attrs(attributes(made))


def _mean(values: np.ndarray, quantity: str) -> tuple[float, float, float]:
    """Return the mean of finite values, (start,), and its 95 % interval by Student's t, which may leave [0, 1)."""
    from scipy.special import stdtrit

    known = unrolled(values) if (phase := quantity in PHASES) else values
    known = known[np.isfinite(known)]
    if len(known) < 2:
        return (float(known.mean()) if len(known) else np.nan), np.nan, np.nan
    middle, half = known.mean(), stdtrit(len(known) - 1, 0.975) * known.std(ddof=1) / np.sqrt(len(known))
    middle = middle % 1.0 if phase else middle
    return middle, middle - half, middle + half


def walked_in_words(result: "xr.Dataset") -> str:
    """Return a text with the number of starts that walked whole strides at each speed."""
    count = result.value.sel(quantity="speed").notnull().sum("start").values
    numbers = zip(count, result.speed.values, strict=True)
    return ", ".join(f"{n} of {result.sizes['start']} at {speed:g} mm/s" for n, speed in numbers)


def table_rows(result: "xr.Dataset") -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table, each with a text for every column of `HEADS`."""
    for n in range(result.sizes["row"]):
        row = {name: result[name].values[n] for name in result.data_vars if result[name].dims == ("row",)}
        at = f" at {row['at']:g} mm/s" if row["depends"] else ""
        unit = f" [{row['unit']}]" if row["unit"] != "1" else ""
        interval = f" ({row['low']:.3g} to {row['high']:.3g})" if row["low"] < row["high"] else ""
        insects = _range(row["animal_low"], row["animal_high"])
        verdict = row["verdict"] + (", built in" if row["built_in"] else "")
        yield f"{row['name']}{at}{unit}", _range(row["mean"], row["mean"]) + interval, insects, verdict, row["source"]


def biology_markdown(result: "xr.Dataset") -> str:
    """Return the comparison with real insects and its sources as a Markdown table and list."""
    named = {*result.source.values}
    sources = [f"- {name}: {text}" for name, text in SOURCES.items() if name in named and text]
    walks = f"Starts with whole strides: {walked_in_words(result)}."
    return "\n".join([*markdown_table(HEADS, table_rows(result)), "", walks, "", *sources]) + "\n"


def _range(low: float, high: float) -> str:
    """Return a range as a text such as "1 to 2", "above 1" or "1"; "-" if it is unknown."""
    if math.isnan(low):
        return "-"
    if math.isinf(low) or math.isinf(high):
        return f"above {low:.3g}" if math.isinf(high) else f"below {high:.3g}"
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"


def biology_figure(result: "xr.Dataset") -> "Figure":
    """Draw forces and torques as bars for each pair of legs, and gait over speed with the ranges of real insects."""
    figure = picture(10.0, 6.4)
    axes = figure.subplots(2, 3).ravel()
    for panel, (label, names) in zip(axes[:2], BARS.items(), strict=True):
        _bars(panel, result.value.sel(speed=SPEED).transpose("quantity", "start"), names)
        panel.set_title(label, fontsize=9)
    for panel, (name, label) in zip(axes[2:], OVER_SPEED.items(), strict=True):
        _over_speed(panel, result.value.sel(quantity=name), name)
        panel.set(xlabel="speed [mm/s]")
        panel.set_title(label, fontsize=9)
    axes[2].legend(**LEGEND)
    within, known = ((result.verdict.isin(words)).sum().item() for words in (["within"], ["below", "within", "above"]))
    shown = f"means with 95 % intervals; bars at {SPEED:g} mm/s; whole strides: {walked_in_words(result)}"
    head(figure, f"{within} of {known} quantities are within the range of real insects", caption(result), shown)
    return figure


def _bars(axes: "Axes", values: "xr.DataArray", names: tuple[str, ...]) -> None:
    """Draw means over the starts of `values`, (quantity, start), as a group of bars for each pair of legs."""
    for n, name in enumerate(names):
        middle, ends = _means(values.sel(quantity=[f"{name}, {segment}" for segment in SEGMENTS]), name)
        label = name.removesuffix(" impulse").removesuffix(" torque")
        style = {"color": SERIES[n]["color"], "capsize": 2, "label": label, "yerr": ends, "zorder": 2}
        axes.bar(np.arange(len(SEGMENTS)) + (n - 1) * 0.27, middle, 0.25, **style)
    axes.set_xticks(range(len(SEGMENTS)), [f"{segment} legs" for segment in SEGMENTS])
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    axes.margins(y=0.2)  # room for the legend
    axes.legend(**LEGEND, loc="upper left")
    tidy(axes)


def _over_speed(axes: "Axes", values: "xr.DataArray", name: str) -> None:
    """Draw means over the starts of `values`, (speed, start), against speed, with the ranges of real insects."""
    for row in ANIMALS:
        if row.quantity == name:
            ends = (row.speed - 0.4, row.speed + 0.4) if row.depends else (20.0, 40.0)
            axes.fill_between(ends, row.low, row.high, color=INSECTS, alpha=0.5, linewidth=0)
    axes.errorbar(values.speed, *_means(values.transpose("speed", "start"), name), label="simulated insect", **OURS)
    axes.fill_between([], [], color=INSECTS, alpha=0.5, linewidth=0, label="range of real insects")
    axes.set_xlim(20.0, 40.0)
    tidy(axes)


def _means(values: "xr.DataArray", quantity: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean over the starts in each row of (row, start), and error bars below and above, (2, row)."""
    middle, low, high = np.transpose([_mean(row, quantity) for row in np.asarray(values)])
    return middle, np.stack([middle - low, high - middle])
