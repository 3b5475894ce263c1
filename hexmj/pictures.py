"""Figures that show themselves in a notebook, made without pyplot."""

import io
from collections.abc import Iterator
from contextlib import contextmanager

import matplotlib
from matplotlib.figure import Figure


class Picture(Figure):
    """A figure of matplotlib; what it can do is in its documentation, first of all `savefig`."""

    def _repr_png_(self) -> bytes:
        """What a notebook shows."""
        drawn = io.BytesIO()
        self.savefig(drawn, format="png", dpi=100)
        return drawn.getvalue()


@contextmanager
def as_shipped() -> Iterator[None]:
    """Meanwhile matplotlib draws as it is shipped, whatever a file `matplotlibrc` asks for: commands draw the same
    everywhere."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        yield


def picture(width: float, height: float) -> Picture:
    """An empty figure, its size in inches, whose parts make room for each other."""
    return Picture(figsize=(width, height), layout="constrained")


def in_figure(text: str) -> str:
    """A text for figures, in which dollars do not begin a formula."""
    return text.replace("$", r"\$")


def head(figure: Figure, *lines: str) -> None:
    """The title of a figure, in lines that are broken where they do not fit."""
    figure.suptitle("\n".join(filter(None, lines)), fontsize=10, wrap=True)
