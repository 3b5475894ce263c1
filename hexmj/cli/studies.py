"""`hexmj map`, `hexmj disturb`, `hexmj terrain`, `hexmj converge` and `hexmj biology`."""

from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import StudyCommand
from hexmj.cli.output import Column, difference, grid, interval, lists_of, over_velocity, table

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

SAME = {
    "measured": "agreement_measured",
    "grounded": "agreement_grounded",
    "physical": "agreement",
    "same feet": "same_feet",
    "at the ground": "same_feet_grounded",
}
"""Heading -> the fraction of starts with the kinematic answer, or of steps in which the planned feet stand."""

OFF = {
    "margin": "margin",
    "grounded": "margin_grounded",
    "pressure": "margin_pressure",
    "same feet": "margin_same_feet",
    "drift": "drift",
    "slip": "slip",
    "tracking": "tracking",
}
"""Heading -> the distance of the walk from its plan."""


class Map(StudyCommand):
    """Map the physical FLSS over the velocity and one condition, with the mechanisms by which starts fall or do not. A
    run that was stopped resumes if it is repeated."""

    study = "studies.stability_map:StabilityMap"
    hidden = ("feedback",)
    data = "{over}.nc"
    figures = {"{over}": "map", "{over}-mechanisms": "mechanisms"}  # noqa: RUF012
    manifest = "{over}-manifest.json"
    examples = (
        "--over vp --velocity 0.5 --starts 20",
        "--over friction --values 0.2 1 --controller hws --out results/ice",
    )

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return super().summary(result) | {"starts": result.sizes["start"]}

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.measures.compare import MEASURES

        saved: dict[str, Column] = {"static": lambda data: f"{data.static.item():.3f}", "saved": _saved}
        changes = {name: partial(difference, measure=name) for name in ("dynamics", "change")}
        counts = {f"{value:g}": _count(value) for value in result.value.values}
        yield f"{study.controller.name} over {study.over}: FLSS, with 95 % intervals; physical: falls"
        froude = {"Froude": lambda data: f"{data.froude.item():.2g}"}
        yield grid(result, ("value", "velocity"), froude | {name: name for name in MEASURES})
        yield (
            "Saved: of the starts with a static loss, those that do not fall; dynamics: physical less static FLSS;"
            f" change: physical FLSS less that at {study.over} = {result.attrs['reference']:g}"
        )
        yield grid(result, ("value", "velocity"), saved | changes)
        yield f"Mechanisms: numbers of starts at each {study.over}"
        yield grid(result, ("velocity", "mechanism_name"), counts)
        toppled = (result.topple < float("inf")).sum("start").to_dataset(name="count")
        yield "Starts that toppled"
        yield grid(toppled, ("velocity",), counts)
        stand = (f"{n} at {value:g}" for n, value in zip(result.stand.values, result.value.values, strict=True))
        yield (
            f"{result.sizes['start']} of {study.n_starts} starts, which stand on six feet and reach nine of ten tips at"
            f" every value ({', '.join(stand)})"
        )


def _saved(data: "xr.Dataset") -> str:
    return interval(data, "saved") if data.static.item() else "none lost"


def _count(value: float) -> Column:
    return lambda data: str(data["count"].sel(value=value).item())


class Disturb(StudyCommand):
    """Disturb walks by a halt, a stopped leg or a push, and measure what three strategies gain, kinematically and
    physically. A run that was stopped resumes if it is repeated."""

    study = "studies.disturbance:DisturbedWalks"
    data = "disturb.nc"
    figures = {"disturb": "disturb"}  # noqa: RUF012
    examples = ("--kinematic --velocity 0.5", "--disturbances push --impulses 40 --strategies grasp")

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.disturbance import MEASURES, strategies_in_words

        for measure in MEASURES:
            if measure in result:
                yield from _disturbed(result, measure)
        if {*result.strategy.values} - {"none"}:
            yield "takes off: how much lower than without a strategy, on the same starts"
        found = (f"{n} at V = {v:g}" for n, v in zip(result.drawn.values, result.velocity.values, strict=True))
        yield f"{study.n_starts} starts whose plan is stable until it is disturbed, the first of {', '.join(found)}"
        if words := strategies_in_words(result):
            yield words


def _disturbed(result: "xr.Dataset", measure: str) -> "Iterable[str | Table]":
    """Yield the FLSS by one measure and what the strategies take off it, each under its heading."""
    strategy, kinds = result.strategy.values, [name.partition(" ")[0] for name in result.disturbance.values]
    kinematic = [kind != "push" and answer != "grasp" for kind, answer in zip(kinds, strategy, strict=True)]
    cases = [n for n, either in enumerate(kinematic) if either or measure == "physical"]
    answered, slow = ([n for n in cases if strategy[n] != "none"], [n for n in cases if strategy[n] == "slow_down"])
    yield (
        f"{measure} FLSS after the disturbance, of at least {result[f'{measure}_reached'].min().item()} starts, with"
        " 95 % intervals" + ("; the observation time begins at full velocity again" if slow else "")
    )
    whole = result.sel(observation_time="whole")
    yield _cases(whole.isel(case=cases), measure, interval)
    if slow:
        yield "The same if the observation time begins with the disturbance"
        yield _cases(result.sel(observation_time="short").isel(case=slow), measure, interval)
    if answered:
        yield f"What a strategy takes off the {measure} FLSS"
        yield _cases(whole.isel(case=answered), f"{measure}_buys", difference)


def _cases(result: "xr.Dataset", name: str, text: "Callable[[xr.Dataset, str], str]") -> "Table":
    """Return a table with a row for each case, and a column for each velocity."""
    columns = {"disturbance": lambda data: data.disturbance.item(), "strategy": _strategy}
    columns |= over_velocity(result, lambda data: text(data, name))
    rows = [[column(result.isel(case=case)) for column in columns.values()] for case in range(result.sizes["case"])]
    return table(columns, rows)


def _strategy(data: "xr.Dataset") -> str:
    return data.strategy.item().replace("_", " ")


class Terrain(StudyCommand):
    """Measure how often the insect falls once it has reached a step, a gap, a hurdle or rough ground. A run that was
    stopped resumes if it is repeated."""

    study = "studies.terrain:Terrain"
    data = "terrain.nc"
    figures = {"terrain": "terrain"}  # noqa: RUF012
    examples = ("--velocity 0.4 --starts 10", "--grounds step --heights 2 4 --grasps 0 1 --controller wilson")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return lists_of(result[["flss", "flss_low", "flss_high", "reached", "crossed"]])

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        def fell_on(data: "xr.Dataset") -> str:
            parts = data.fall_part.values[data.after.values].astype(int)
            counts = Counter(study.conditions.body.trunk[part] for part in parts)
            return ", ".join(f"{part} {number}" for part, number in counts.most_common())

        columns = over_velocity(result, partial(interval, measure="flss"))
        columns["crossed"] = lambda data: f"{data.crossed.sum().item()} of {data.reached.sum().item()}"
        yield "FLSS once the obstacle has been reached, with 95 % intervals; earlier falls do not count"
        yield grid(result, ("obstacle", "grasp"), columns | {"fell on": fell_on})
        yield f"commanded distance {result.attrs['distance']:g} mm"


class Converge(StudyCommand):
    """Walk from the same starts at smaller and smaller V_p: the insect approaches its plan, and physical stability the
    static criterion. A run that was stopped resumes if it is repeated."""

    study = "studies.static_limit:StaticLimit"
    data = "converge.nc"
    figures = {"converge": "converge"}  # noqa: RUF012
    examples = ("--velocity 0.5 --starts 20", "--vps 200 50 --leg-masses 1 --controller hws")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return lists_of(_means(result))

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.static_limit import LOSSES

        means, axes = _means(result), ("leg_mass", "vp")
        yield f"V = {study.velocity:g}: FLSS, with 95 % intervals; physical: falls"
        yield grid(means, axes, [*LOSSES])
        yield "Starts with the kinematic answer; steps in which the planned feet stand, or are at the ground"
        yield grid(means, axes, SAME)
        yield (
            "Distances from the planned margin until the plan loses stability: of the measured one, of that with all"
            " feet at the ground, of the centre of pressure's, of the measured one while the same feet stand; of the"
            " centre of mass from O [mm]; slip [mm/s] and tracking [mm] to the end"
        )
        yield grid(means, axes, OFF)


def _means(result: "xr.Dataset") -> "xr.Dataset":
    """Return the means over the starts."""
    from hexmj.studies.static_limit import LOSSES

    return result.drop_vars(LOSSES.values()).mean("start", keep_attrs=True)


class Biology(StudyCommand):
    """Compare forces, torques, gait, posture and work of the walking insect with those of measured insects. A run that
    was stopped resumes if it is repeated."""

    study = "studies.biology:Biology"
    data = "biology.nc"
    figures = {"biology": "biology"}  # noqa: RUF012
    examples = ("--starts 5", "--controller walknet --vp 120 --out results/walknet")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return lists_of(result.drop_dims(("start", "speed", "quantity")))

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.biology import HEADS, table_rows, walked_in_words

        yield f"{study.controller.name} beside insects, at 24 mm/s unless another speed is given"
        yield table(HEADS, table_rows(result))
        yield f"starts with whole strides: {walked_in_words(result)}; sources in biology.md"

    def others(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        from hexmj.files import write_text
        from hexmj.studies.biology import biology_markdown

        return [write_text(given.out / "biology.md", biology_markdown(result))]
