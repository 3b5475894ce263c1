"""Footfall diagrams as a notebook shows them: which feet are off the ground, a bar for each swing."""

from html import escape

import numpy as np

from hexmj.legs import LEGS

WIDTH, ROW, LEFT = 640, 14, 28
"""Of the bars, height of a leg's row, and room for the names of legs [pixels]."""


def spans(time: np.ndarray, on: np.ndarray) -> list[tuple[float, float]]:
    """Begin and length of each stretch of time in which `on`, (step,), holds; `time` is that of the steps' ends."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    step = time[1] - time[0] if len(time) > 1 else 0.0
    return [(float(time[a] - step), float((b - a) * step)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def footfall_html(line: str, time: np.ndarray, swings: np.ndarray, told: str) -> str:
    """A line of text and a footfall diagram below it.

    Args:
        line: says what it is.
        time: at the end of each step, (step,), at least two [time units].
        swings: which feet are off the ground, (step, leg).
        told: stands below the bars, beside the time.
    """
    step = time[1] - time[0]
    begin, scale = time[0] - step, WIDTH / (time[-1] - time[0] + step)
    bars = [
        f'<rect x="{LEFT + scale * (at - begin):.1f}" y="{ROW * leg + 2}" width="{scale * length:.1f}"'
        f' height="{ROW - 4}"/>'
        for leg in range(len(LEGS))
        for at, length in spans(time, swings[:, leg])
    ]
    names = [f'<text x="0" y="{ROW * (leg + 1) - 3}">{name}</text>' for leg, name in enumerate(LEGS)]
    low = ROW * (len(LEGS) + 1)
    axis = [
        f'<text x="{LEFT}" y="{low}">{begin:.4g}</text>',
        f'<text x="{LEFT + WIDTH / 2}" y="{low}" text-anchor="middle">bars: foot off the ground; {escape(told)}</text>',
        f'<text x="{LEFT + WIDTH}" y="{low}" text-anchor="end">{time[-1]:.4g} time units</text>',
    ]
    style = 'style="max-width: 100%" fill="currentColor" font-family="sans-serif" font-size="11"'
    box = f'viewBox="0 0 {LEFT + WIDTH} {low + 4}" width="{LEFT + WIDTH}"'
    return f"<p>{escape(line)}</p><svg {box} {style}>{''.join(bars + names + axis)}</svg>"
