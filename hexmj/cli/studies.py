"""`hexmj map`, `hexmj disturb`, `hexmj terrain` and `hexmj biology`."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import StudyCommand
from hexmj.cli.output import HEADS, Column, difference, grid, interval, lists_of, over_velocity, table

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


class Map(StudyCommand):
    """Map the physical FLSS over the velocity and one condition, and count the mechanisms that make starts fall or keep
    them from falling. Repeat the command to resume a stopped run."""

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
        names = {"physical - static": "dynamics", "change": "change"}
        changes = {name: partial(difference, measure=measure) for name, measure in names.items()}
        axes, at = (study.over, "velocity"), result.rename(value=study.over)
        over = HEADS.get(study.over, study.over.replace("_", " "))
        yield f"{study.controller.name} over {over}: FLSS, with 95 % intervals"
        yield "physical: falls; Froude: the number (V V_p)^2 / (g h)"
        froude = {"Froude": lambda data: f"{data.froude.item():.2g}"}
        yield grid(at, axes, froude | {name: name for name in MEASURES})
        yield (
            "static: FLSS of the plan with the body's own centre of mass; saved: fraction of these losses without a"
            f" fall; change: physical FLSS minus that at {over} = {result.attrs['reference']:g}"
        )
        yield grid(at, axes, saved | changes)
        yield f"Number of starts at each {over} by what keeps them up or makes them fall (see hexmj.studies.mechanisms)"
        yield table(("velocity", "starts", *(f"{value:g}" for value in result.value.values)), _mechanisms(result), 2)
        stand = (f"{n} at {value:g}" for n, value in zip(result.stand.values, result.value.values, strict=True))
        yield (
            f"{result.sizes['start']} of {study.n_starts} starts are counted: they stand on six feet and reach at least"
            f" nine of ten tips at every value ({', '.join(stand)})"
        )


def _saved(data: "xr.Dataset") -> str:
    return interval(data, "saved") if data.static.item() else "none lost"


def _mechanisms(result: "xr.Dataset") -> Iterator[list[str]]:
    """Yield velocity, mechanism and counts at each value; a mechanism without starts at the velocity is left out."""
    for v in result.velocity.values:
        data = result.sel(velocity=v)
        counts = {name: data["count"].sel(mechanism_name=name).values for name in result.mechanism_name.values}
        yield from ([f"{v:g}", name.replace("_", " "), *map(str, n)] for name, n in counts.items() if n.any())


class Disturb(StudyCommand):
    """Disturb walks by a halt, a stopped leg or a push, and measure how much three strategies reduce the kinematic and
    physical FLSS. Repeat the command to resume a stopped run."""

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
            yield "Reduction: FLSS without a strategy minus FLSS with it, on the same starts"
        found = (f"{n} at V = {v:g}" for n, v in zip(result.drawn.values, result.velocity.values, strict=True))
        yield f"{study.n_starts} starts whose plan is stable until the disturbance; starts drawn: {', '.join(found)}"
        if words := strategies_in_words(result):
            yield words


def _disturbed(result: "xr.Dataset", measure: str) -> "Iterable[str | Iterator[Table]]":
    """Yield headings and tables for one measure of FLSS: its values, and how much the strategies reduce it."""
    strategy, kinds = result.strategy.values, [name.partition(" ")[0] for name in result.disturbance.values]
    kinematic = [kind != "push" and answer != "grasp" for kind, answer in zip(kinds, strategy, strict=True)]
    cases = [n for n, planned in enumerate(kinematic) if planned or measure == "physical"]
    answered, slow = ([n for n in cases if strategy[n] != "none"], [n for n in cases if strategy[n] == "slow_down"])
    yield (
        f"{measure} FLSS after the disturbance, of at least {result[f'{measure}_reached'].min().item()} starts, with"
        " 95 % intervals"
        + ("; counted until one observation time after full velocity is reached again" if slow else "")
    )
    whole = result.sel(observation_time="whole")
    yield _cases(whole.isel(case=cases), measure, interval)
    if slow:
        yield f"{measure} FLSS counted until one observation time after the disturbance"
        yield _cases(result.sel(observation_time="short").isel(case=slow), measure, interval)
    if answered:
        yield f"Reduction of the {measure} FLSS by a strategy"
        yield _cases(whole.isel(case=answered), f"{measure}_buys", difference)


def _cases(result: "xr.Dataset", name: str, text: "Callable[[xr.Dataset, str], str]") -> "Iterator[Table]":
    """Yield a table with a row for each disturbance and strategy (case), and a column for each velocity."""
    columns = {"disturbance": lambda data: data.disturbance.item(), "strategy": _strategy}
    columns |= over_velocity(result, lambda data: text(data, name))
    rows = [[column(result.isel(case=case)) for column in columns.values()] for case in range(result.sizes["case"])]
    return table(columns, rows, 2)


def _strategy(data: "xr.Dataset") -> str:
    return data.strategy.item().replace("_", " ")


class Terrain(StudyCommand):
    """Measure how often the insect falls after it has reached a step, a gap, a hurdle or rough ground. Repeat the
    command to resume a stopped run."""

    study = "studies.terrain:Terrain"
    data = "terrain.nc"
    figures = {"terrain": "terrain"}  # noqa: RUF012
    examples = ("--velocity 0.4 --starts 10", "--grounds step --heights 2 4 --grasps 0 1 --controller wilson")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return lists_of(result[["flss", "flss_low", "flss_high", "reached", "crossed"]])

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        parts = result.fall_part.values[result.after.values].astype(int)
        fell_on = Counter(study.conditions.body.trunk[part] for part in parts).most_common()
        columns = over_velocity(result, partial(interval, measure="flss"))
        columns["crossed"] = lambda data: f"{data.crossed.sum().item()} of {data.reached.sum().item()}"
        yield "FLSS after the obstacle has been reached, with 95 % intervals; earlier falls do not count"
        yield grid(result, ("obstacle", "grasp"), columns)
        yield "grasp: adhesion over the weight; crossed: starts that crossed the obstacle, of those that reached it"
        yield f"parts that touched the ground: {', '.join(f'{part} {n}' for part, n in fell_on) or 'none'}"
        yield f"commanded distance {result.attrs['distance']:g} mm"


class Biology(StudyCommand):
    """Compare forces, torques, gait, posture and work of the simulated insect with measurements of real insects. Repeat
    the command to resume a stopped run."""

    study = "studies.biology:Biology"
    data = "biology.nc"
    figures = {"biology": "biology"}  # noqa: RUF012
    examples = ("--starts 5", "--controller walknet --vp 120 --out results/walknet")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        return lists_of(result.drop_dims(("start", "speed", "quantity")))

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.biology import table_rows, walked_in_words

        rows = [row[:4] for row in table_rows(result)]
        known = [row for row in rows if row[2] != "-"]

        yield f"{study.controller.name} and real insects, at 24 mm/s unless a row names another speed"
        yield table(("quantity", "ours (95 %)", "insects", "verdict"), known, None)
        yield f"biology.md has the sources, and {len(rows) - len(known)} more quantities without a figure for insects"
        yield f"Starts with complete strides: {walked_in_words(result)}"

    def write_more(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        from hexmj.files import write_text
        from hexmj.studies.biology import biology_markdown

        return [write_text(given.out / "biology.md", biology_markdown(result))]
