"""Tables, lines and JSON that the commands print."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import product
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

Column = str | Callable[["xr.Dataset"], str]
"""A variable, or a function that returns the text of a cell from the data of its row."""

HEADS = {"velocity": "V", "vp": "V_p", "leg_mass": "legs", "mechanism_name": "starts that"}
"""Axis of a result -> its heading in tables."""

GAP = 2
"""Columns of the screen between those of a table."""


def show(*parts: Any) -> None:
    """Print tables and lines."""
    from rich.console import Console
    from rich.padding import Padding

    console = Console(highlight=False, soft_wrap=False, markup=False, emoji=False)
    for part in parts:
        console.print(part if isinstance(part, str) else Padding(part, (1, 0), expand=False))


def print_json(value: dict[str, Any]) -> None:
    """Print a JSON object."""
    from hexmj.io import json_text

    print(json_text(value))


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> "Table":
    """Return a table; cells that are too wide for the screen are folded."""
    from rich import box
    from rich.table import Table

    made = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for column in head:
        made.add_column(column.replace("_", " "), overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def tables_that_fit(head: Sequence[str], rows: Sequence[Sequence[str]]) -> "Iterator[Table]":
    """Yield a table in one or several parts as wide as the screen, each with the first column."""
    from rich.console import Console

    width = Console().width
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    parts, used = [[0]], widths[0]
    for column, own in enumerate(widths[1:], 1):
        if used + GAP + own > width and len(parts[-1]) > 1:
            parts.append([0])
            used = widths[0]
        parts[-1].append(column)
        used += GAP + own
    for part in parts:
        yield table([head[column] for column in part], [[row[column] for column in part] for row in rows])


def grid(result: "xr.Dataset", axes: Sequence[str], columns: Mapping[str, Column] | Iterable[str]) -> "Table":
    """Return a table with a row for each label of some axes.

    Args:
        result: the data.
        axes: the last one varies fastest.
        columns: heading -> column; of names alone, each is its own heading.
    """
    columns = columns if isinstance(columns, Mapping) else {name: name for name in columns}
    rows = []
    for labels in product(*(result[axis].values.tolist() for axis in axes)):
        data = result.sel(dict(zip(axes, labels, strict=True)))
        names = (f"{label:g}" if isinstance(label, float) else label.replace("_", " ") for label in labels)
        rows.append((*names, *(_text(data, column) for column in columns.values())))
    return table((*(HEADS.get(axis, axis) for axis in axes), *columns), rows)


def over_velocity(result: "xr.Dataset", text: Callable[["xr.Dataset"], str]) -> dict[str, Column]:
    """Return columns for `grid`, one for each velocity."""

    def column(v: float) -> Column:
        return lambda data: text(data.sel(velocity=v))

    return {f"V = {v:g}": column(v) for v in result.velocity.values}


def _text(data: "xr.Dataset", column: Column) -> str:
    """Return a variable as text, with its interval if there is one."""
    if not isinstance(column, str):
        return column(data)
    return interval(data, column) if f"{column}_low" in data else f"{data[column].item():.3f}"


def interval(data: "xr.Dataset", measure: str) -> str:
    """Return a frequency with its interval, such as 0.520 (.39-.64)."""
    middle, low, high = (data[measure + end].item() for end in ("", "_low", "_high"))
    return "-" if middle != middle else f"{middle:.3f} ({low:.2f}-{high:.2f})".replace("(0", "(").replace("-0", "-")


def difference(data: "xr.Dataset", measure: str) -> str:
    """Return a difference of frequencies with its interval, such as +.12 (+.02 to +.22)."""
    middle, low, high = (data[measure + end].item() for end in ("", "_low", "_high"))
    return "-" if middle != middle else f"{middle:+.2f} ({low:+.2f} to {high:+.2f})".replace("0.", ".")


def four_digits(value: float) -> str:
    """Return a number with four digits, or a whole number if it has more."""
    return f"{value:.0f}" if value >= 1000 else f"{value:.4g}"


def lists_of(result: "xr.Dataset") -> dict[str, Any]:
    """Return all coordinates and variables of a result as lists, and its settings, for JSON."""
    from hexmj.io import settings

    return {str(name): result[name].values.tolist() for name in result.variables} | {"settings": settings(result)}


def report_line(report: dict[str, float]) -> str:
    """Return a report as one line."""
    return "; ".join(f"{key}: {value:{'.3g' if isinstance(value, float) else ''}}" for key, value in report.items())


def report_checks(findings: Iterable[Any], json: bool, **beside: Any) -> NoReturn:
    """Print the finding of each check as it comes, or one JSON object, and exit with 1 if one is not well.

    Args:
        findings: frozen dataclasses with `name`, `well` and `found`, and perhaps `remedy` and `note`.
        json: prints JSON.
        beside: more members of the JSON object.
    """
    checks = []
    for finding in findings:
        checks.append(finding)
        if not json:
            remedy = f" Remedy: {finding.remedy}" if getattr(finding, "remedy", "") else ""
            kind = "note " if getattr(finding, "note", False) else "ok   " if finding.well else "WRONG"
            print(f"{kind}  {finding.name}: {finding.found}{remedy}", flush=True)
    well = all(finding.well for finding in checks)
    if json:
        print_json(beside | {"well": well, "checks": [asdict(finding) for finding in checks]})
    sys.exit(0 if well else 1)
