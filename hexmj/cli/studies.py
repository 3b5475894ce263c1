"""`hexmj map`, `hexmj disturb`, `hexmj terrain`, `hexmj converge` and `hexmj biology`."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import StudyCommand
from hexmj.cli.output import difference, interval, lists_of, table

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


def results(name: str, data: str = "") -> type:
    """Return a dataclass with the option --out, by default results/NAME."""

    @dataclass(frozen=True)
    class Results:
        out: Path = Path("results") / name
        """Folder for figure, NetCDF, manifest and cached results."""

    return Results


class Map(StudyCommand):
    """Map the physical FLSS over the velocity and one condition, with the mechanisms by which starts fall or do not. A
    run that was stopped resumes if it is repeated."""

    study = "studies.stability_map:StabilityMap"
    own = (results("map"),)
    hidden = ("feedback",)
    doing = "mapping"
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

        measures, changes, mechanisms = [], [], []
        for value in result.value.values:
            for v in result.velocity.values:
                data, at = result.sel(value=value, velocity=v), (f"{value:g}", f"{v:g}")
                measures.append((*at, f"{data.froude.item():.2g}", *(interval(data, name) for name in MEASURES)))
                saved = interval(data, "saved") if data.static.item() else "none lost"
                changes.append(
                    (*at, f"{data.static.item():.3f}", saved, difference(data, "dynamics"), difference(data, "change"))
                )
        for v in result.velocity.values:
            for name in result.mechanism_name.values:
                counts = result["count"].sel(velocity=v, mechanism_name=name).values
                mechanisms.append((f"{v:g}", name.replace("_", " "), *map(str, counts)))
            toppled = (result.topple.sel(velocity=v) < float("inf")).sum("start")
            mechanisms.append((f"{v:g}", "toppled, of all", *map(str, toppled.values)))
        yield f"{study.controller.name} over {study.over}: FLSS, with 95 % intervals; physical: falls"
        yield table(("value", "V", "Froude", *MEASURES), measures)
        yield (
            "Saved: of the starts with a static loss, those that do not fall; dynamics: physical less static FLSS;"
            f" change: physical FLSS less that at {study.over} = {result.attrs['reference']:g}"
        )
        yield table(("value", "V", "static", "saved", "dynamics", "change"), changes)
        yield f"Mechanisms, and how many toppled: numbers of starts at each {study.over}"
        yield table(("V", "starts that", *(f"{value:g}" for value in result.value.values)), mechanisms)
        stand = (f"{n} at {value:g}" for n, value in zip(result.stand.values, result.value.values, strict=True))
        yield (
            f"{result.sizes['start']} of {study.n_starts} starts, which stand on six feet and reach nine of ten tips at"
            f" every value ({', '.join(stand)})"
        )


class Disturb(StudyCommand):
    """Disturb walks by a halt, a stopped leg or a push, and measure what three strategies gain, kinematically and
    physically. A run that was stopped resumes if it is repeated."""

    study = "studies.disturbance:DisturbedWalks"
    own = (results("disturb"),)
    doing = "disturbing walks"
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
    rows = []
    for case in range(result.sizes["case"]):
        row = result.isel(case=case)
        cells = (text(row.sel(velocity=v), name) for v in result.velocity.values)
        rows.append((row.disturbance.item(), row.strategy.item().replace("_", " "), *cells))
    return table(("disturbance", "strategy", *(f"V = {v:g}" for v in result.velocity.values)), rows)


class Terrain(StudyCommand):
    """Measure how often the insect falls once it has reached a step, a gap, a hurdle or rough ground. A run that was
    stopped resumes if it is repeated."""

    study = "studies.terrain:Terrain"
    own = (results("terrain"),)
    doing = "walking to obstacles"
    data = "terrain.nc"
    figures = {"terrain": "terrain"}  # noqa: RUF012
    examples = ("--velocity 0.4 --starts 10", "--grounds step --heights 2 4 --grasps 0 1 --controller wilson")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return lists_of(result[["flss", "flss_low", "flss_high", "reached", "crossed"]])

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        rows = []
        for name in result.obstacle.values:
            for grasp in result.grasp.values:
                data = result.sel(obstacle=name, grasp=grasp)
                frequencies = (interval(data.sel(velocity=v), "flss") for v in result.velocity.values)
                crossed = f"{data.crossed.sum().item()} of {data.reached.sum().item()}"
                parts = data.fall_part.values[data.after.values].astype(int)
                counts = {part: int((parts == i).sum()) for i, part in enumerate(study.conditions.body.trunk)}
                most = sorted(counts.items(), key=lambda item: -item[1])
                fell = ", ".join(f"{part} {n}" for part, n in most if n)
                rows.append((name, f"{grasp:g}", *frequencies, crossed, fell))
        yield "FLSS once the obstacle has been reached, with 95 % intervals; earlier falls do not count"
        yield table(("obstacle", "grasp", *(f"V = {v:g}" for v in result.velocity.values), "crossed", "fell on"), rows)
        yield f"commanded distance {result.attrs['distance']:g} mm"


class Converge(StudyCommand):
    """Walk from the same starts at smaller and smaller V_p: the insect approaches its plan, and physical stability the
    static criterion. A run that was stopped resumes if it is repeated."""

    study = "studies.static_limit:StaticLimit"
    own = (results("converge"),)
    doing = "walking slower and slower"
    data = "converge.nc"
    figures = {"converge": "converge"}  # noqa: RUF012
    examples = ("--velocity 0.5 --starts 20", "--vps 200 50 --leg-masses 1 --controller hws")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return lists_of(_means(result))

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.static_limit import LOSSES

        means = _means(result)
        yield f"V = {study.velocity:g}: FLSS, with 95 % intervals; physical: falls"
        yield _limits(means, {measure: partial(interval, measure=measure) for measure in LOSSES})
        yield "Starts with the kinematic answer; steps in which the planned feet stand, or are at the ground"
        yield _limits(means, {heading: partial(_number, name=name) for heading, name in SAME.items()})
        yield (
            "Distances from the planned margin until the plan loses stability: of the measured one, of that with all"
            " feet at the ground, of the centre of pressure's, of the measured one while the same feet stand; of the"
            " centre of mass from O [mm]; slip [mm/s] and tracking [mm] to the end"
        )
        yield _limits(means, {heading: partial(_number, name=name) for heading, name in OFF.items()})


def _means(result: "xr.Dataset") -> "xr.Dataset":
    """Return the means over the starts."""
    from hexmj.studies.static_limit import LOSSES

    return result.drop_vars(LOSSES.values()).mean("start", keep_attrs=True)


def _limits(means: "xr.Dataset", columns: Mapping[str, "Callable[[xr.Dataset], str]"]) -> "Table":
    """Return a table with a row for each mass of the legs and V_p."""
    rows = [
        (f"{mass:g}", f"{vp:g}", *(column(means.sel(leg_mass=mass, vp=vp)) for column in columns.values()))
        for mass in means.leg_mass.values
        for vp in means.vp.values
    ]
    return table(("legs", "V_p", *columns), rows)


def _number(data: "xr.Dataset", name: str) -> str:
    return f"{data[name].item():.3f}"


class Biology(StudyCommand):
    """Compare forces, torques, gait, posture and work of the walking insect with those of measured insects. A run that
    was stopped resumes if it is repeated."""

    study = "studies.biology:Biology"
    own = (results("biology"),)
    doing = "walking beside the animal"
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
