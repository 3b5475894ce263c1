"""What the site does beyond MkDocs: pictures open at full size, and reference pages are filled from the program.

A page contains `<!-- generated: NAME -->`; the function of that name in `GENERATED` returns the Markdown in its place.
"""

import ast
import logging
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from inspect import getdoc, getsource
from itertools import pairwise
from pathlib import Path
from sys import modules
from textwrap import dedent, indent
from typing import Any

import numpy as np
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

import hexmj
from hexmj.bodies.kinematics import joint_numbers, posed
from hexmj.bodies.mjcf import plain_model
from hexmj.body import PARTS
from hexmj.cli.main import HELP, command
from hexmj.conditions import Conditions, ranges
from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.cruse1998 import OWN_TABLES, presets
from hexmj.controllers.registry import searched_on
from hexmj.physics.outcomes import Outcomes
from hexmj.replay import recording

ROOT = Path(__file__).parents[1]
FOLDED = {"walk": "Options of the plan", "conditions": "Conditions", "execution": "Execution"}
"""Group of options that many commands share -> its title on the page, where it is folded."""


def on_startup(**_: Any) -> None:
    """Report warnings with --quiet too; without this, --quiet hides them from --strict."""
    log = logging.getLogger("mkdocs")
    log.setLevel(min(log.level, logging.WARNING))


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replace the markers of a page by generated Markdown."""
    return re.sub(r"<!-- generated: (\w+) -->", lambda found: GENERATED[found[1]](), markdown)


def on_page_content(html: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """A picture is a link to itself."""
    return re.sub(r'<img [^>]*src="([^"]+)"[^>]*>', r'<a href="\1">\g<0></a>', html)


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a Markdown table."""
    lines = [list(heads), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def texts(source: Any) -> dict[str, str]:
    """Return name -> docstring of the attributes of a class or a module, in one line."""
    tree: Any = ast.parse(dedent(getsource(source)))
    found = {}
    for statement, text in pairwise(tree.body[0].body if isinstance(source, type) else tree.body):
        match statement, text:
            case (
                (ast.AnnAssign(target=ast.Name(name)) | ast.Assign(targets=[ast.Name(name)])),
                ast.Expr(ast.Constant(str(words))),
            ):
                found[name] = " ".join(words.split())
    return found


def commands() -> str:
    """List the commands as `hexmj --help` does, then each with its options."""
    groups = [block.split("\n") for block in HELP.split("\n\n") if "\n  " in block]
    named = [(title, [line.split(maxsplit=1) for line in lines]) for title, *lines in groups]
    rows = ((f"[{name}](#hexmj-{name})", text) for _, lines in named for name, text in lines)
    parts = (part for title, lines in named for part in (f"## {title}", *(one_command(name) for name, _ in lines)))
    return "\n\n".join([table(("command", "what it does"), rows), *parts])


def one_command(name: str) -> str:
    """Return the section of a command: summary, usage and examples, options by group."""
    chosen = command(name)
    summary = " ".join((getdoc(chosen) or "").split())
    positional, parts = "", []
    for member in fields(chosen.options(name)):
        kind = getattr(member.type, "__origin__", None)
        kind = getattr(kind, "__origin__", kind)  # without OmitArgPrefixes
        if not is_dataclass(kind):
            positional = f" {member.name.upper()}"
            parts.append(option(member))
            continue
        options = "\n\n".join(option(part) for part in fields(kind))
        title = FOLDED.get(member.name) if member.name != name else None
        parts.append(f'??? note "{title}"\n\n{indent(options, "    ")}' if title else options)
    examples = "\n".join(f"hexmj {name} {words}".rstrip() for words in chosen.examples)
    usage = f"```text\nhexmj {name} [OPTIONS]{positional}\n\n{examples}\n```"
    return "\n\n".join([f"### hexmj {name}", summary, usage, *parts])


def option(member: Any) -> str:
    """Return an option as an entry of a definition list."""
    (config, *positional), default = member.type.__metadata__, member.default
    head = config.name.upper() if positional else f"--{config.name}"
    value = " ".join(map(str, default)) if isinstance(default, tuple) else str(default)
    known = default is not MISSING and default is not None and default is not False and value
    return f"`{head}`\n:   {config.help}{f' Default: `{value}`.' if known else ''}"


def meaning(text: str) -> tuple[str, str]:
    """Split the docstring of an attribute into its unit and its meaning."""
    text = re.sub(r"^\([a-z, 0-9]+\) ", "", text)
    if not (found := re.search(r" \[([^\];]+)\]", text)):
        return "", text
    return found[1], text[: found.start()] + text[found.end() :]


def number(value: Any, unit: str) -> str:
    """Return a default with its unit."""
    text = np.format_float_positional(value, trim="-") if isinstance(value, float) else getattr(value, "name", value)
    return f"{text} {unit.removeprefix('1 ')}".strip()


def settings(kind: type, limits: Mapping[str, tuple[float, float, bool]] = {}) -> str:
    """Return the fields of a dataclass with default, unit and meaning, and the range of those in `limits`."""
    rows, defaults = [], kind()
    for name, text in texts(kind).items():
        unit, words = meaning(text)
        least, most, above = limits.get(name, (0, 0, False))
        allowed = f"more than {least:g}, at most {most:g}" if above else f"{least:g} to {most:g}"
        words += f" Allowed: {allowed}." if name in limits else ""
        default = "fig1" if name == "geometry" else number(getattr(defaults, name), unit)
        rows.append((f"`{name}`", default, words))
    return table(("field", "default", "meaning"), rows)


def outcomes() -> str:
    """Return the outcomes of a physical walk with unit and meaning."""
    rows = ((f"`{name}`", *meaning(text)) for name, text in texts(Outcomes).items())
    return table(("outcome", "unit", "meaning"), rows)


def recorded() -> str:
    """Return the variables of a recording."""
    parts = []
    for title, variables in (
        ("Coordinates", recording.TIMES),
        ("In every recording", recording.PLANNED),
        ("Only in physical walks", recording.MEASURED),
    ):
        rows = ((f"`{v}`", text, unit, ", ".join(dims) or "one number") for v, (dims, unit, text) in variables.items())
        parts += [f"## {title}", table(("variable", "meaning", "unit", "dimensions"), rows)]
    return "\n\n".join(parts)


def baselines() -> str:
    """Return the baseline controllers: rule and senses, then the docstring of each module."""
    rules: dict[str, list[str]] = {}
    for name, controller in BASELINES.items():
        rules.setdefault(type(controller).__module__, []).append(name)
    rows, notes = [], []
    for place, names in rules.items():
        text = getdoc(modules[place]) or ""
        shown = ", ".join(f"`{name}`" for name in names)
        sensed = re.search(r"Sensed: (.+?)\.(?:\s|$)", text, flags=re.DOTALL)
        rows.append((shown, text.partition("\n")[0], " ".join(sensed[1].split()) if sensed else ""))
        spaced = re.sub(r"(?m)^(?! |\n)(.*)\n(?=    )", r"\1\n\n", text)  # blank lines around equations
        spaced = re.sub(r"(?m)^(    .*)\n(?=\S)", r"\1\n\n", spaced)
        notes.append(f'??? note "Sources and rules of {", ".join(names)}"\n\n{indent(spaced, "    ")}')
    return "\n\n".join([table(("name", "rule", "senses"), rows), *notes])


def weight_sets() -> str:
    """Return the weight sets of the 1998 network, each with its source and the seeds of its search."""
    words = texts(presets)
    rows = [(f"`{name.lower()}`", words[name], "none") for name in ("HWS", "LDVS", "UNCOORDINATED")]
    alike: dict[tuple[str, str], list[str]] = {}
    for name, entry in OWN_TABLES.items():
        seeds = ", ".join(str(seed) for found in searched_on(name).values() for seed in found)
        about = "found by a search" if seeds else f"made by `{entry['command']}`"
        about += " for the velocity in the name" if name[-1].isdigit() else " for V = 0.1 to 0.5"
        about += ", for a low mean FLSS over all variants" if "--over mean" in entry["command"] else ""
        about += ", with the model variant `lasting`" if entry.get("model_variant") == "lasting" else ""
        alike.setdefault((about, seeds or "none"), []).append(f"`{name}`")
    rows += [(", ".join(sorted(names)), *row) for row, names in alike.items()]
    return table(("name", "weights", "seeds of the search"), rows)


def insect() -> str:
    """Return lengths, masses and joint ranges of the stick insect, from its MJCF."""
    body = hexmj.STICK_INSECT
    model = plain_model(body)
    data, numbers = posed(model, model.key(body.home).qpos), joint_numbers(model, body)[:3]
    places = np.concatenate([data.xanchor[numbers], [[data.site(leg.foot).xpos] for leg in body.legs[:3]]], axis=1)
    lengths = np.linalg.norm(np.diff(places, axis=1), axis=-1)
    ranges = np.rad2deg(model.jnt_range[numbers]).round()
    legs, trunk = [], [(part, f"{1000 * model.body(part).mass.item():.0f} mg") for part in body.trunk]
    for leg, which in enumerate(("front", "middle", "hind")):
        for part, name, length, (low, high) in zip(body.legs[leg].parts, PARTS, lengths[leg], ranges[leg], strict=True):
            mass = 1000 * model.body(part).mass.item()
            legs.append((f"{which} {name}", f"{length:.1f} mm", f"{mass:.1f} mg", f"{low:g} to {high:g} degrees"))
    heads = ("part of a leg", "length", "mass", "range of its joint")
    return "\n\n".join([table(heads, legs), table(("part of the trunk", "mass"), trunk)])


def examples() -> str:
    """Return the scripts in `examples/` with the first line of their docstrings."""
    trees = {path.name: ast.parse(path.read_text()) for path in sorted(ROOT.glob("examples/*.py"))}
    rows = ((f"`{name}`", (ast.get_docstring(tree) or "").partition("\n")[0]) for name, tree in trees.items())
    return table(("script", "what it shows"), rows)


def from_root(name: str) -> str:
    """Return a page of the repository's root, with links that work from `docs/project/`."""
    return (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](../")


GENERATED: dict[str, Callable[[], str]] = {
    "commands": commands,
    "conditions": lambda: settings(Conditions, ranges(hexmj.STICK_INSECT, "flat")),
    "stride": lambda: settings(hexmj.Stride),
    "acceleration": lambda: settings(hexmj.Acceleration),
    "outcomes": outcomes,
    "recording": recorded,
    "baselines": baselines,
    "weights": weight_sets,
    "insect": insect,
    "examples": examples,
    "contributing": lambda: from_root("CONTRIBUTING.md"),
    "changelog": lambda: from_root("CHANGELOG.md"),
}
"""Name in a marker -> function that returns the Markdown in its place."""
