"""Overlay on the frames of a film: caption, scale bar, legend of all marks, and a growing footfall diagram."""

from functools import cache
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image, ImageDraw, ImageFont

from hexmj.legs import LEGS
from hexmj.plotting import MEASURE_STYLES
from hexmj.rendering.scene_marks import CENTRE, STABLE, TIP
from hexmj.replay.film import Film
from hexmj.replay.take import Take, margin_in_words
from hexmj.walks import spans

INK, FAINT, PAPER = (24, 26, 28), (120, 124, 126), (250, 250, 247)
GREEN, RED = (0, 112, 72), (190, 56, 0)
"""Text colours of stable (green) and unstable (red) postures. Their symbols and words differ too."""

MINUS, TIMES = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"

CAPTION, STRIP, DIAGRAM, BARS = 48, 18, 80, 64
"""Heights on a frame of 640 x 480 pixels, as all sizes in this file. The body's cameras keep these areas free. `BARS`
is the part of the diagram above its time axis."""


class Overlay:
    """Draws caption, scale bar, legend and footfall diagram of one take on frames of one size."""

    def __init__(self, take: Take, film: Film, begin: float, end: float) -> None:
        """Draw the legend and the complete diagram in advance, with a time axis from `begin` to `end` [s]."""
        self._take, self._begin, self._end, width, height = take, begin, end, film.width, film.height
        self._speed = "in real time" if film.slow_motion == 1 else f"at {1 / film.slow_motion:.2g} {TIMES} speed"
        self._scale = min(width / 640, height / 480)
        self._top, self._bottom = self._pixels(CAPTION), height - self._pixels(DIAGRAM)
        self._left, self._right = self._pixels(30), width - self._pixels(12)
        lost = f"loss at {1000 * take.lost:.0f} ms" if np.isfinite(take.lost) else "no loss"
        self._loss = f"{'grounded' if take.physical else 'planned'} {lost}"
        self._swing = MEASURE_STYLES["grounded" if take.physical else "kinematic"]["color"]
        self._legend = self._marks()
        self._blank, self._full = (self._diagram(width, height - self._bottom, bars) for bars in (False, True))

    def draw(self, frame: np.ndarray, row: int, seconds: float, scale: float) -> None:
        """Draw on a frame that shows the walk.

        Args:
            frame: (height, width, 3), changed in place.
            row: index of the step at whose end the frame shows the body.
            seconds: time of the frame on the time axis of the diagram [s].
            scale: pixels per mm at the centre of mass; 0 if the centre of mass is behind the camera.
        """
        now, cursor = self._column(seconds), self._pixels(1)
        diagram = frame[self._bottom :]
        diagram[:] = self._blank
        diagram[:, :now] = self._full[:, :now]
        diagram[: self._pixels(BARS), now : now + cursor] = INK
        frame[: self._top] = self._caption(frame[: self._top], row, seconds)
        strip = frame[self._bottom - self._pixels(STRIP) : self._bottom]
        strip[:] = self._strip(strip, scale)

    def _strip(self, background: np.ndarray, scale: float) -> np.ndarray:
        """Return `background` with the legend, and a scale bar of a round length at the centre of mass."""
        image, font, edge = _faded(background, 0.6), _font(self._pixels(11)), self._pixels(10)
        image.paste(self._legend, (image.width - self._legend.width, 0), self._legend)
        draw, middle = ImageDraw.Draw(image), image.height // 2
        if scale > 0:
            longest = self._pixels(75) / scale
            power = 10.0 ** np.floor(np.log10(longest))
            length = max(float(power * part) for part in (1, 2, 5) if power * part <= longest)
            end = edge + round(length * scale)
            draw.line((edge, middle, end, middle), INK, self._pixels(1.5))
            for x in (edge, end):
                draw.line((x, middle - self._pixels(3), x, middle + self._pixels(3)), INK, self._pixels(1))
            draw.text((end + self._pixels(5), middle), f"{length:g} mm", INK, font, "lm")
        return np.asarray(image)

    def _marks(self) -> Image.Image:
        """Return the legend of the marks in the scene and of the diagram's bars."""
        tip, polygon, centre = (tuple(round(255 * part) for part in colour) for colour in (TIP, STABLE, CENTRE))
        marks = ("●", INK), ("▬", self._swing), ("◎", tip), ("■", polygon), ("●", centre)
        text = "● foot at the ground  ▬ ○ above it  ◎ planned tip  ■ support polygon  ● centre of mass  "
        font = _font(self._pixels(11))
        image = Image.new("RGBA", (round(font.getlength(text)), self._pixels(STRIP)), (*PAPER, 0))
        draw, middle, end = ImageDraw.Draw(image), image.height / 2, 0
        draw.text((0, middle), text, INK, font, "lm")
        for mark, colour in marks:
            end = text.index(mark, end) + 1
            draw.text((font.getlength(text[: end - 1]), middle), mark, colour, font, "lm")
        return image

    def _caption(self, background: np.ndarray, row: int, seconds: float) -> np.ndarray:
        """Return `background` with title and state in the first line, and time, velocities and margin in the second."""
        take, edge = self._take, self._pixels(10)
        bold, plain = _font(self._pixels(15), bold=True), _font(self._pixels(12))
        image = _faded(background, 0.8)
        draw, first, second = ImageDraw.Draw(image), round(0.29 * self._top), round(0.75 * self._top)
        state, colour = self._state(row, seconds)
        title = _shortened(take.title, bold, image.width - 3 * edge - bold.getlength(state))
        draw.text((edge, first), title, INK, bold, "lm")
        draw.text((image.width - edge, first), state, colour, bold, "rm")
        fields = {
            0.0: f"{1000 * seconds:.0f} ms = {seconds * take.conditions.vp:.1f} time units, {self._speed}",
            0.46: f"V = {take.velocity[row]:.2f}",
            0.565: f"Vₚ = {take.conditions.vp:g} mm/s",
        }
        margin = margin_in_words(take.margin[row]).replace("-", MINUS)
        last = self._loss if seconds >= take.fell else margin
        draw.text((image.width - edge, second), last, INK, plain, "rm")
        for place, text in fields.items():
            draw.text((edge + place * (image.width - 2 * edge), second), text, INK, plain, "lm")
        return np.asarray(image)

    def _state(self, row: int, seconds: float) -> tuple[str, tuple[int, int, int]]:
        """Return a text on the state of the body (stable, unstable, fallen), and the colour of the text."""
        take, after = self._take, f" ({self._loss})" if seconds >= self._take.lost else ""
        if seconds >= take.fell:
            return f"■ {take.part} touches the ground at {1000 * take.fell:.0f} ms", RED
        if not take.begin - take.step / 2 <= seconds <= take.end + take.step / 2:  # beside a longer recording
            return f"recorded from {1000 * take.begin:.0f} to {1000 * take.end:.0f} ms", FAINT
        if take.margin[row] <= 0:
            return "▲ unstable" + after, RED
        return "● stable" + after, GREEN

    def _diagram(self, width: int, height: int, bars: bool) -> np.ndarray:
        """Return the diagram, with or without bars and the line of the first loss, (height, width, 3)."""
        take, size = self._take, np.array([width, height])
        figure = Figure(size / 72, dpi=72, facecolor=[part / 255 for part in PAPER])
        left, right, bottom = self._left / width, self._right / width, 1 - self._pixels(BARS) / height
        axes = figure.add_axes((left, bottom, right - left, 1 - bottom), facecolor="none", frameon=False)
        axes.set(xlim=(1000 * self._begin, 1000 * self._end), ylim=(6.0, -0.3), yticks=np.arange(6) + 0.5)
        axes.set_yticklabels(LEGS)
        axes.tick_params(labelsize=self._pixels(9), length=self._pixels(2), pad=self._pixels(2), width=self._scale)
        axes.xaxis.set_major_locator(MaxNLocator(11, steps=(1, 2, 5, 10)))
        axes.text(-0.01, -0.03, "ms", transform=axes.transAxes, ha="right", va="top", fontsize=self._pixels(9))
        if bars:
            time = 1000 * (take.begin + take.step * np.arange(1, len(take.stance) + 1))
            for leg in range(6):
                axes.broken_barh(spans(time, ~take.stance[:, leg]), (leg + 0.1, 0.8), color=self._swing)
            for begin, end in ((self._begin, take.begin), (take.end, self._end)):
                axes.axvspan(1000 * begin, 1000 * max(begin, end), color="0.85")
            if np.isfinite(take.lost):
                axes.axvline(1000 * take.lost, color="#be3200", linewidth=1.5 * self._scale)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _column(self, seconds: float) -> int:
        """Return the pixel column of a time [s] in the diagram."""
        part = (seconds - self._begin) / (self._end - self._begin)
        return self._left + round(part * (self._right - self._left - 1))

    def _pixels(self, size: float) -> int:
        """Convert a length on a frame of 640 x 480 pixels to pixels of this film's frames."""
        return max(1, round(size * self._scale))


def _faded(background: np.ndarray, share: float) -> Image.Image:
    """Return an image of `background` mixed with this share of the colour of paper."""
    return Image.blend(Image.fromarray(background), Image.new("RGB", background.shape[1::-1], PAPER), share)


def _shortened(text: str, font: ImageFont.FreeTypeFont, width: float) -> str:
    """Return a text, cut and with an ellipsis if it is wider than `width` [pixels]."""
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(f"{text}…") > width:
        text = text[:-1]
    return f"{text}…"


@cache
def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name, size)
