"""Command lines as nobody should type them."""

import contextlib
import io
import re
import sys
from functools import cache

from hypothesis import strategies as st

from hexmj.cli.main import main

SMALL = {
    "compare": "--starts 2 --window 3 --velocities 0.5 --no-video",
    "flss": "--starts 3 --window 3 --velocities 0.5",
    "walk": "--window 3",
    "render": "--window 1 --width 64 --height 48 --fps 5",
    "search": "--form hws --starts 3 --population 4 --budget 8 --refine-starts 3 --refine-budget 3 --verdict-starts 3"
    " --window 3",
    "reproduce": "--only nothing",
    "converge": "--vps 400 --starts 2 --window 2",
    "terrain": "--grounds step --heights 1 --velocities 0.5 --starts 1 --grasps 0",
    "map": "--values 80 --velocities 0.5 --starts 2 --window 3",
    "biology": "--starts 1 --periods 4",
    "disturb": "--velocities 0.5 --starts 2 --window 3 --disturbances halt --strategies reorganise",
    "rerun": "nowhere",
    "check-controller": "nobody",
    "doctor": "--json",
}
"""Name of a command -> options with which it ends soon."""

NUMBERS = (
    "0", "1", "2", "3", "0.5", "0.1", "0.9", "0.25", "-1", "-0.0", "1.5", "nan", "inf", "-inf", "1e-320", "1e-9",
    "1e15", "1e23", "1e308", "-1e308", "1e309", "1" + 23 * "0", "-1" + 23 * "0", 5000 * "9", "0x10", "1_0", "½", "٣",
    "1,5", "1e",
)  # fmt: skip
WORDS = (
    "", " ", ".", "..", "/", "-", "--", "None", "true", "walk", "start", "ldvs", "hws", "own", "own-0.3", "mine.py",
    ":", "mine.py:Nobody", "os:system", "sys:argv", "nowhere.toml", "[red]", "[red].toml", "[/]", "$$", "$$.toml",
    "$x_{$", "\x1b[31m", "a\nb", "a\tb", "\x07", "é", "字", "\udcff", "a" * 300, "x" * 5000, "2026-11-22T12:30",
    "%s %d", "{}", "{0}", "~", "/proc/none", "/proc/self", "/dev/full", "/dev/null", "/dev/null/x", "/etc/shadow",
    "/root/none", "|", "out/deep/er", "vp", "friction", "flat", "rough", "planned", "printed", "sequential",
    "push", "cmaes", "high", "top",
)  # fmt: skip


@cache
def offered(command: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The options of a command, and the words that its help names in braces."""
    told = io.StringIO()
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(told):
        sys.argv = ["hexmj", command, "--help"]
        main()
    options = sorted(set(re.findall(r"--[a-z][a-z0-9-]*", told.getvalue())) - {"--help"})
    choices = {word for braces in re.findall(r"\{([a-z0-9_,|-]+)\}", told.getvalue()) for word in braces.split(",")}
    return tuple(options), tuple(sorted(choices))


@st.composite
def command_lines(draw: st.DrawFn) -> tuple[str, ...]:
    """The words behind `hexmj`: one that ends soon, and some more."""
    command = draw(st.sampled_from(tuple(SMALL)))
    options, choices = offered(command)
    line = [command, *SMALL[command].split()]
    line += ["--threads", "1"] if "--threads" in options else []
    line += ["--out", "out"] if "--out" in options else []
    word = st.one_of(st.sampled_from(NUMBERS), st.sampled_from(WORDS + choices), st.text(max_size=12))
    typed = word.filter(lambda word: "\0" not in word)
    fewest = draw(st.sampled_from((0, 1, 1, 1, 1)))
    for option in draw(st.lists(st.sampled_from(options), min_size=fewest, max_size=4)):
        line += [option, *draw(st.one_of(st.lists(typed, max_size=2), typed.map(lambda word: [word])))]
    return tuple(line)


def typed(line: tuple[str, ...]) -> None:
    """What the command does that was typed."""
    sys.argv = ["hexmj", *line]
    main()
