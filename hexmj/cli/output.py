"""Tables, lines and JSON that the commands print."""

import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

HEADS = {"velocity": "V", "vp": "V_p", "duration": "t", "agreement": "agree", "dynamic_agreement": "agree, dynamic"}
HEADS |= {"leg_mass": "mass", "flss": "FLSS", "flds": "FLDS"}
"""Axis or variable of a result -> its heading in tables, where it is not its name."""

NARROW = 0.05
"""Width of an interval up to which its ends are printed with three digits."""

GAP = 2
"""Number of characters between two columns of a table."""


def show(*parts: Any) -> None:
    """Print tables and lines."""
    from rich.console import Console
    from rich.padding import Padding

    console = Console(highlight=False, soft_wrap=False, markup=False, emoji=False)
    for part in parts:
        for item in [part] if isinstance(part, str) else part:
            console.print(item if isinstance(item, str) else Padding(item, (1, 0), expand=False))


def table(head: Iterable[str], rows: Iterable[Iterable[str]], repeated: int | None = 1) -> "Iterator[Table]":
    """Yield a table of texts, split by columns into parts that fit the width of the screen.

    Args:
        head: heading of each column.
        rows: texts of each row.
        repeated: number of columns at the left that every part repeats; with None, long cells continue on further lines
            instead.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    columns = [
        *zip([HEADS.get(name, name.replace("_", " ") if name.islower() else name) for name in head], *rows, strict=True)
    ]
    width, widths = Console().width, [max(map(len, column)) for column in columns]
    parts = [columns[:repeated]]
    for column, own in zip(columns[repeated:], widths[repeated:], strict=True) if repeated else ():
        used = sum(max(map(len, column)) + GAP for column in parts[-1])
        if used + own > width and len(parts[-1]) > (repeated or 0):
            parts.append(columns[:repeated])
        parts[-1].append(column)
    for part in parts:
        screen = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
        for name, *_ in part:
            screen.add_column(name, overflow="fold")
        for row in zip(*(texts for _, *texts in part), strict=True):
            screen.add_row(*row)
        yield screen


def grid(result: "xr.Dataset", axes: Sequence[str], columns: Sequence[str]) -> "Iterator[Table]":
    """Yield a table, or parts that fit the screen, with one row for each combination of labels along some axes.

    Args:
        result: the data.
        axes: names of the axes; the last axis varies fastest.
        columns: names of variables; a variable with an interval is shown with it.
    """
    rows = []
    for labels in product(*(result[axis].values.tolist() for axis in axes)):
        data = result.sel(dict(zip(axes, labels, strict=True)))
        names = (f"{label:g}" if isinstance(label, float) else str(label).replace("_", " ") for label in labels)
        cells = (interval(data, c) if f"{c}_low" in data else four_digits(data[c].item()) for c in columns)
        rows.append((*names, *cells))
    return table((*axes, *columns), rows, len(axes))


def interval(data: "xr.Dataset", measure: str) -> str:
    """Return a frequency with its interval, such as 0.520 (.39-.64) or, if it is narrow, 0.520 (.514-.526)."""
    middle, low, high = (data[measure + end].item() for end in ("", "_low", "_high"))
    ends = (f"{end:.{2 if high - low > NARROW else 3}f}" for end in (low, high))
    text = "-".join("1.0" if float(end) == 1.0 else end.removeprefix("0") for end in ends)
    return "-" if middle != middle else f"{middle:.3f} ({text})"


def four_digits(value: float) -> str:
    """Return a number with four significant digits; a number of 1000 or more is rounded to a whole number."""
    return f"{value:.0f}" if value >= 1000 else f"{value:.4g}"


def report_line(report: dict[str, float]) -> str:
    """Return the entries of a report as one line, `key: value` separated by semicolons."""
    return "; ".join(f"{key}: {value:{'.3g' if isinstance(value, float) else ''}}" for key, value in report.items())


def report_checks(findings: Iterable[Any], json: bool, **beside: Any) -> NoReturn:
    """Print each finding as soon as its check ends, or one JSON object, and exit: code 0 if all checks pass, else 1.

    Args:
        findings: objects with `name`, `well` (passed) and `found`, and optionally `note`.
        json: whether to print one JSON object instead of lines.
        beside: further members of the JSON object.
    """
    checks = []
    for finding in findings:
        checks.append({"name": finding.name, "well": finding.well, "found": finding.found})
        if not json:
            kind = "note " if getattr(finding, "note", False) else "ok   " if finding.well else "WRONG"
            print(f"{kind}  {finding.name}: {finding.found}", flush=True)
    well = all(check["well"] for check in checks)
    if json:
        from hexmj.io import json_text

        print(json_text(beside | {"well": well, "checks": checks}))
    sys.exit(0 if well else 1)
