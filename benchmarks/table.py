"""The figures of `make bench` as one table, each beside its peers, in the terminal and in Markdown.

    python -m benchmarks.table FOLDER

It reads FOLDER/benchmark.json (pytest-benchmark) and writes FOLDER/table.md.
"""

import json
import platform
import re
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hexmj.files import write_text
from hexmj.threads import cores

COLUMNS = ["what", "hexmj", "bar", "peer", "ratio"]


def figure(benchmark: dict[str, Any]) -> float:
    """Return the amount per second of the median round, or its seconds, or the test's own figure."""
    info, seconds = benchmark["extra_info"], benchmark["stats"]["median"]
    return info.get("figure") or (info["amount"] / seconds if info["amount"] else seconds)


def rows(benchmarks: list[dict[str, Any]]) -> list[list[str]]:
    """Return one row for each figure of hexmj and each peer; a ratio above 1 is in favour of hexmj."""
    lines = []
    for benchmark in benchmarks:
        info, ours = benchmark["extra_info"], figure(benchmark)
        if info["who"] != "hexmj":
            continue
        more_is_better = info["unit"] not in ("s", "MB")
        row = [info["what"], f"{short(ours)} {info['unit']}", ""]
        peers = [p for p in benchmarks if p["extra_info"]["what"] == info["what"] and p is not benchmark]
        for peer in peers:
            theirs = figure(peer)
            ratio = ours / theirs if more_is_better else theirs / ours
            if peer is peers[0]:
                row[2] = f"ratio {info['ratio']:g}, " + ("met" if ratio >= info["ratio"] else "NOT MET")
            lines.append([*row, f"{peer['extra_info']['who']}: {short(theirs)}", short(ratio)])
            row = ["", "", ""]
    return lines


def short(number: float) -> str:
    """Return a number with three digits, without an exponent."""
    return f"{float(f'{number:.3g}'):,g}" if number < 1e6 else f"{number:,.0f}"


def description() -> str:
    """Return processor, cores of this process, operating system and Python in one line."""
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else ""
    name = re.search(r"model name\s*: (.+)", text)
    cpu = name[1] if name else platform.processor()
    return f"{cpu}, {cores()} cores, {platform.system()}, Python {platform.python_version()}"


def print_table(columns: list[str], lines: list[list[str]]) -> None:
    """Print a table in the terminal."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(escape(column), overflow="fold")
    for line in lines:
        table.add_row(*map(escape, line))
    Console(width=150, highlight=False).print(table)


def main(folder: str) -> None:
    """Print the table and write it."""
    lines = rows(json.loads((Path(folder) / "benchmark.json").read_text(encoding="utf-8"))["benchmarks"])
    print_table(COLUMNS, lines)
    print(description())
    markdown = "".join(f"| {' | '.join(line)} |\n" for line in [COLUMNS, ["---"] * len(COLUMNS), *lines])
    write_text(Path(folder) / "table.md", f"{description()}\n\n{markdown}")


if __name__ == "__main__":
    main(sys.argv[1])
