"""Films of recordings: the body, its support polygon, a caption and a footfall diagram."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import xarray as xr

from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError, RenderingError
from hexmj.files import replacing
from hexmj.progress import Progress, shown
from hexmj.rendering import gl
from hexmj.rendering.scene_marks import mark_centre_of_mass, mark_feet, mark_planned_tips, mark_support
from hexmj.replay.film import MOST_PANELS, Film
from hexmj.replay.overlay import Overlay
from hexmj.replay.take import Take, takes_of
from hexmj.validate import choice

ENCODINGS: dict[str, dict[str, Any]] = {
    ".mp4": {"crf": 20, "ffmpeg_args": "-preset veryfast -movflags +faststart"},
    ".gif": {"codec": "gif"},
}
"""Suffix of a film's name -> options of the encoder."""

AFTER_FALL = 0.25
"""Time for which a film shows a fallen body [s of the walk]."""


def render(
    recordings: Sequence[xr.Dataset],
    path: Path | str,
    film: Film | None = None,
    progress: Progress | bool | None = None,
    *,
    body: Body = STICK_INSECT,
) -> int:
    """Film one recording, or up to six side by side with one clock. A body that fell stays in its last pose.

    Args:
        recordings: one to six recordings; four or more are shown in two rows.
        path: file of the film, with the suffix .mp4 or .gif.
        film: camera, size, speed and quality.
        progress: True for a bar, or a function that receives the fraction done since its last call.
        body: description of the recorded body.

    Returns:
        Number of frames. The film ends with the last recording, or `AFTER_FALL` after the last fall.

    Raises:
        InputError: no recording or too many, another suffix, a recording without a pose or of another body.
        RenderingError: nothing can be rendered on this machine, or ffmpeg fails.
    """
    film, path = film or Film(), Path(path)
    if path.suffix not in ENCODINGS:
        raise InputError(f"path = {path}; expected a name with {' or '.join(ENCODINGS)}")
    choice("camera", film.camera, body.cameras)
    film.check_format(path.suffix.removeprefix("."))
    takes = takes_of(recordings, body, MOST_PANELS)
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
    rows = 1 if len(takes) <= 3 else 2
    columns = -(-len(takes) // rows)
    picture = np.full((film.height * rows, film.width * columns, 3), 255, dtype=np.uint8)
    panels = [panel for row in np.split(picture, rows) for panel in np.split(row, columns, axis=1)][: len(takes)]
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
    ahead = float(np.dot(centre - lens.pos, lens.forward))
    if ahead <= lens.frustum_near:
        return renderer.render(), 0.0
    distance = lens.frustum_near if lens.orthographic else ahead
    scale = renderer.height * lens.frustum_near / ((lens.frustum_top - lens.frustum_bottom) * distance)
    return renderer.render(), scale
