"""What a browser shows of a live walk beside the insect: a footfall diagram, and what is said of a moment."""

import numpy as np

from hexmj.diagrams import spans
from hexmj.legs import LEGS
from hexmj.replay.take import margin_in_words
from hexmj.view.live import Moment
from hexmj.view.session import LiveSession

CHARTED = 2.0
"""Time that the charts show [s]."""


def footfall(seconds: np.ndarray, off: np.ndarray) -> str:
    """A footfall diagram as SVG: bars while a foot is off the ground, (time, leg)."""
    end = float(seconds[-1])
    bars = [
        f'<rect x="{100 * (1 + (begin - end) / CHARTED):.2f}" y="{10 * leg + 2}" height="7"'
        f' width="{100 * lasts / CHARTED:.2f}"/>'
        for leg in range(6)
        for begin, lasts in spans(seconds, off[:, leg])
    ]
    names = "".join(f'<div style="height:{100 / 6}%">{name}</div>' for name in LEGS)
    return (
        '<div style="text-align:center">feet off the ground, the same time</div><div style="display:flex;height:9em;'
        f'margin:0 1.2em .6em .6em"><div style="width:2.2em">{names}</div><svg viewBox="0 0 100 60" width="100%"'
        f' height="100%" preserveAspectRatio="none" fill="currentColor">{"".join(bars)}</svg></div>'
    )


def readout(session: LiveSession, moment: Moment) -> str:
    """What is said of a moment, in Markdown."""
    walk = session.walk
    state = f"fell on {walk.fell_on}" if walk.fell_on else f"{'within' if moment.margin > 0 else 'outside'} the polygon"
    sign = "\N{HEAVY CHECK MARK}" if moment.margin > 0 and not walk.fell_on else "\N{HEAVY MULTIPLICATION X}"
    lines = [
        f"**{margin_in_words(moment.margin)}** {sign} {state}",
        f"V = {moment.velocity:.2f}, {moment.seconds:.2f} s, start {session.start};"
        f" {session.factor:.2f} times real time",
    ]
    return "\n\n".join(lines + ([f"_{session.told}_"] if session.told else []))
