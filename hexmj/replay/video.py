"""Films of recordings: the body with its support polygon, a caption, a legend and a growing footfall diagram."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from textwrap import shorten
from typing import Any, Literal

import matplotlib
import mujoco
import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image, ImageDraw, ImageFont

from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError, RenderingError
from hexmj.files import replacing
from hexmj.legs import LEGS
from hexmj.plotting import MEASURE_STYLES
from hexmj.progress import Progress, shown
from hexmj.rendering import gl
from hexmj.rendering.scene_marks import (
    CENTRE,
    STABLE,
    TIP,
    mark_centre_of_mass,
    mark_feet,
    mark_planned_tips,
    mark_support,
)
from hexmj.replay.take import Take, margin_in_words, takes_of
from hexmj.validate import choice, number, whole
from hexmj.walks import spans

ENCODINGS: dict[str, dict[str, Any]] = {
    ".mp4": {"crf": 20, "ffmpeg_args": "-preset veryfast -movflags +faststart"},
    ".gif": {"codec": "gif"},
}
"""Suffix of a film's name -> options of the encoder."""

AFTER_FALL = 0.25
"""Time for which a film shows a fallen body [s of the walk]."""

INK, FAINT, PAPER = (24, 26, 28), (120, 124, 126), (250, 250, 247)
GREEN, RED = (0, 112, 72), (190, 56, 0)
"""Text colours of stable (green) and unstable (red) postures. Their symbols and words differ too."""

MINUS, TIMES = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"

CAPTION, STRIP, DIAGRAM, BARS = 48, 18, 80, 64
"""Heights on a frame of 640 x 480 pixels, as all sizes in this file. The body's cameras keep these areas free. `BARS`
is the part of the diagram above its time axis."""


@dataclass(frozen=True)
class Film:
    """Camera, size, speed and quality of a video.

    Raises:
        InputError: a value is out of its range.
    """

    camera: str = "following"
    """Camera of the body; the stick insect has following, side, top and front."""
    width: int = 640
    """Width of the picture of one recording [pixels], an even number."""
    height: int = 480
    """Height of the picture of one recording [pixels], an even number."""
    fps: float = 30.0
    """Frames per second."""
    slow_motion: float = 2.0
    """Factor by which the film is slower than the walk: 2 plays at half speed."""
    quality: Literal["fast", "high"] = "fast"
    """'fast' renders without shadows, reflections and multisampling; 'high' renders with them."""

    def __post_init__(self) -> None:
        for name, most in (("width", 1920), ("height", 1080)):
            if (size := whole(name, getattr(self, name), 64, most)) % 2:
                raise InputError(f"{name} = {size}; expected an even number of pixels")
        number("fps", self.fps, 1.0, 240.0)
        number("slow_motion", self.slow_motion, 0.001, 1000.0)
        choice("quality", self.quality, ("fast", "high"))


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
            scale: pixels per mm at the centre of mass.
        """
        now, cursor = self._column(seconds), self._pixels(1)
        diagram = frame[self._bottom :]
        diagram[:] = self._blank
        diagram[:, :now] = self._full[:, :now]
        diagram[: self._pixels(BARS), now : now + cursor] = INK
        frame[: self._top] = self._caption(frame[: self._top], row, seconds)
        strip = frame[self._bottom - self._pixels(STRIP) : self._bottom]
        image = _faded(strip, 0.6)
        image.paste(self._legend, (image.width - self._legend.width, 0), self._legend)
        self._draw_scale(ImageDraw.Draw(image), image.height // 2, scale)
        strip[:] = np.asarray(image)

    def _draw_scale(self, draw: ImageDraw.ImageDraw, middle: int, scale: float) -> None:
        """Draw a bar of a round length at the centre of mass."""
        edge, longest = self._pixels(10), self._pixels(75) / scale
        power = 10.0 ** np.floor(np.log10(longest))
        length = max(power * part for part in (1, 2, 5) if power * part <= longest)
        end = edge + round(length * scale)
        draw.line((edge, middle, end, middle), INK, self._pixels(2))
        draw.text((end + self._pixels(5), middle), f"{length:g} mm", INK, _font(self._pixels(11)), "lm")

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
        draw.text((edge, first), shorten(take.title, 36, placeholder="…"), INK, bold, "lm")
        draw.text((image.width - edge, first), state, colour, bold, "rm")
        time = f"{1000 * seconds:.0f} ms = {seconds * take.conditions.vp:.1f} time units, {self._speed}"
        velocities = f"V = {take.velocity[row]:.2f}, Vₚ = {take.conditions.vp:g} mm/s"
        margin = self._loss if seconds >= take.fell else margin_in_words(take.margin[row]).replace("-", MINUS)
        for place, text, anchor in ((0.0, time, "lm"), (0.7, velocities, "rm"), (1.0, margin, "rm")):
            draw.text((max(edge, place * image.width - edge), second), text, INK, plain, anchor)
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
        take = self._take
        figure = Figure((width / 72, height / 72), dpi=72, facecolor="#" + bytes(PAPER).hex())
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


def render(
    recordings: Sequence[xr.Dataset],
    path: Path | str,
    film: Film | None = None,
    progress: Progress | bool | None = None,
    *,
    body: Body = STICK_INSECT,
) -> int:
    """Film one recording, or several side by side with one clock. A body that fell stays in its last pose.

    Args:
        recordings: one or more recordings.
        path: file of the film, with the suffix .mp4 or .gif.
        film: camera, size, speed and quality.
        progress: True for a bar, or a function that receives the fraction done since its last call.
        body: description of the recorded body.

    Returns:
        Number of frames. The film ends with the last recording, or `AFTER_FALL` after the last fall.

    Raises:
        InputError: no recording, another suffix, a recording without a pose or of another body.
        RenderingError: nothing can be rendered on this machine, or ffmpeg fails.
    """
    film, path = film or Film(), Path(path)
    if path.suffix not in ENCODINGS:
        raise InputError(f"path = {path}; expected a name with {' or '.join(ENCODINGS)}")
    choice("camera", film.camera, body.cameras)
    takes = takes_of(recordings, body)
    if reason := gl.missing():
        raise RenderingError(reason)
    import imageio_ffmpeg
    import mediapy

    begin, end = min(take.begin for take in takes), max(min(take.end, take.fell + AFTER_FALL) for take in takes)
    frames = max(1, round((end - begin) * film.slow_motion * film.fps))
    times = begin + np.arange(frames) / (film.fps * film.slow_motion)
    overlays = [Overlay(take, film, begin, end) for take in takes]
    with shown(progress, "rendering") as advance, replacing(path) as part:
        try:
            mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
            pictures = _frames(takes, overlays, times, film, advance)
            mediapy.write_video(part.absolute(), pictures, fps=film.fps, **ENCODINGS[path.suffix])
        except (OSError, RuntimeError) as error:
            raise RenderingError(f"ffmpeg failed: {' '.join(str(error).split()):.300}") from None
    return frames


def _frames(
    takes: Sequence[Take], overlays: Sequence[Overlay], times: np.ndarray, film: Film, progress: Progress | None
) -> Iterator[np.ndarray]:
    """Yield frames with the takes side by side at `times` of the walk, (frame,) [s]."""
    picture = np.empty((film.height, film.width * len(takes), 3), dtype=np.uint8)
    panels = np.split(picture, len(takes), axis=1)
    with ExitStack() as opened:
        stages: dict[Conditions, tuple[gl.Renderer, mujoco.MjData]] = {}
        for conditions in dict.fromkeys(take.conditions for take in takes):
            model = _filmed_body(film, conditions)
            renderer = opened.enter_context(gl.Renderer(model, film.height, film.width))
            stages[conditions] = renderer, mujoco.MjData(model)
        for seconds in times.tolist():
            for take, overlay, panel in zip(takes, overlays, panels, strict=True):
                row = take.row(seconds)
                panel[:], scale = _view(stages[take.conditions], film.camera, take, row)
                overlay.draw(panel, row, seconds, scale)
            yield picture
            if progress:
                progress(1 / len(times))


def _filmed_body(film: Film, conditions: Conditions) -> mujoco.MjModel:
    """Return the model of a body on its ground, set up for the size and quality of a film."""
    model = compile_body(conditions).model
    model.vis.global_.offwidth, model.vis.global_.offheight = film.width, film.height
    if film.quality == "high":
        model.vis.quality.shadowsize, model.vis.quality.offsamples = 4096, 4
    else:
        model.vis.quality.offsamples = 0
        model.light_castshadow[:] = False
    return model


def _view(stage: tuple[gl.Renderer, mujoco.MjData], camera: str, take: Take, row: int) -> tuple[np.ndarray, float]:
    """Return the picture of the end of step `row`, (height, width, 3), and its pixels per mm at the centre of mass."""
    renderer, data = stage
    data.qpos[:] = take.qpos[row]
    mujoco.mj_kinematics(renderer.model, data)
    mujoco.mj_comPos(renderer.model, data)
    mujoco.mj_camlight(renderer.model, data)
    renderer.update_scene(data, camera)
    marks, stable, centre = take.conditions.body.marks, bool(take.margin[row] > 0.0), take.centre_of_mass[row]
    corners, level = take.support(row)
    mark_support(renderer.scene, marks, corners, level, stable)
    mark_centre_of_mass(renderer.scene, marks, centre, level, stable)
    mark_planned_tips(renderer.scene, marks, take.planned_tip[row])
    feet = [renderer.model.site(name).id for name in take.conditions.body.feet]
    mark_feet(renderer.scene, marks, data.site_xpos[feet], take.stance[row])
    lens = renderer.scene.camera[0]
    distance = lens.frustum_near if lens.orthographic else float(np.dot(centre - lens.pos, lens.forward))
    scale = renderer.height * lens.frustum_near / ((lens.frustum_top - lens.frustum_bottom) * distance)
    return renderer.render(), scale


def _faded(background: np.ndarray, share: float) -> Image.Image:
    """Return an image of `background` mixed with this share of the colour of paper."""
    return Image.blend(Image.fromarray(background), Image.new("RGB", background.shape[1::-1], PAPER), share)


@cache
def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name, size)
