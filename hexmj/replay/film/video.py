"""Films of recordings, rendered without a screen: the insect, its support polygon, caption and footfall diagram."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from warnings import warn

import mujoco
import numpy as np
import xarray as xr

from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT, Body
from hexmj.checks import given, path_of, typed
from hexmj.conditions import Conditions
from hexmj.errors import InputError, RenderingError
from hexmj.files import replacing
from hexmj.progress import Progress, shown
from hexmj.rendering import gl
from hexmj.rendering.scene_marks import mark_centre_of_mass, mark_planned_tips, mark_support
from hexmj.replay.film import encoder
from hexmj.replay.film.film import MOST_PANELS, Film
from hexmj.replay.film.overlay import Overlay, lacking
from hexmj.replay.take import Take, support_on_ground, takes_of

BRIGHTER = 1.2
"""Without shadows MuJoCo lights nothing beyond its own colour; the ground's is raised by this to make up for it."""

IN_A_ROW = 3
"""Recordings in one row, at most."""

GROUND = "ground"
"""The ground's texture, where an MJCF has it."""


def render(
    recordings: Sequence[xr.Dataset],
    path: Path | str,
    film: Film | None = None,
    progress: Progress | bool | None = None,
    *,
    body: Body = STICK_INSECT,
) -> int:
    """Film one recording, or up to six side by side with one clock; a body that fell stays as it was last seen.

    Args:
        recordings: one to six; from four on they stand in two rows.
        path: of the film, which ends with .mp4 or .gif; it appears whole or not at all.
        film: how it is filmed.
        progress: True shows a bar; or a function that is told the fraction done since it was last called.
        body: the description of what was recorded.

    Warns:
        UserWarning: of a title with characters that the captions' font, DejaVu Sans, lacks; boxes stand for them.

    Returns:
        The number of frames: the time from the first beginning to the last end, at `Film.fps`.

    Raises:
        InputError: no recording or too many, no MP4 or GIF file in a folder that exists, a recording without a pose,
            or a film that cannot be written.
        RenderingError: nothing can be rendered here; says what brings it.
    """
    film, path = given("film", film, Film), path_of(path)
    recordings = typed("recordings", recordings, tuple[xr.Dataset, ...])
    if not 1 <= len(recordings) <= MOST_PANELS:
        raise InputError(f"{len(recordings)} recordings were given; expected 1 to {MOST_PANELS}")
    film.check_camera(typed("body", body, Body))
    film.check_format(path.suffix.removeprefix("."))
    if path.suffix not in encoder.HOW or not path.parent.is_dir():
        ends = " or ".join(encoder.HOW)
        raise InputError(f"the film cannot be written to {path}; expected a name with {ends} in a folder that exists")
    if reason := missing():
        raise RenderingError(reason)
    takes = takes_of(recordings, body)
    begin, end = min(take.begin for take in takes), max(take.end for take in takes)
    frames = max(1, round((end - begin) * film.slow_motion * film.fps))
    overlays = [Overlay(take, film, begin, end) for take in takes]
    for title in dict.fromkeys(take.title for take in takes):
        if boxes := lacking(title):
            warn(
                f"the film shows a box for each of {boxes} in the title {title!r}; its font has none of them",
                stacklevel=2,
            )
    with shown(progress, "rendering") as told, replacing(path) as part:
        _write(takes, overlays, part, begin + np.arange(frames) / (film.fps * film.slow_motion), film, told)
    return frames


def missing() -> str | None:
    """Why no film can be made here and what brings it, in one sentence; None if it can."""
    return gl.missing() or encoder.missing()


def _write(
    takes: Sequence[Take],
    overlays: Sequence[Overlay],
    path: Path,
    times: np.ndarray,
    film: Film,
    progress: Progress | None,
) -> None:
    """Film the takes side by side at some times on their clock, (frame,) [s]; each frame is drawn on and encoded while
    the scenes of the next one are rendered."""
    rows = 1 if len(takes) <= IN_A_ROW else 2
    columns = -(-len(takes) // rows)
    picture = np.full((film.height * rows, film.width * columns, 3), 255, dtype=np.uint8)
    panels = [one for row in np.split(picture, rows) for one in np.split(row, columns, axis=1)][: len(takes)]
    with ExitStack() as opened:
        worlds = {take.conditions: _filmed_insect(film, take.conditions) for take in takes}
        stages = {
            conditions: (opened.enter_context(gl.renderer(model, film.height, film.width)), mujoco.MjData(model))
            for conditions, model in worlds.items()
        }
        add = opened.enter_context(encoder.encoder(path, *picture.shape[:2], film.fps))
        finishing = opened.enter_context(ThreadPoolExecutor(1))

        def finish(views: Sequence[tuple[np.ndarray, float]], seconds: float) -> None:
            for take, overlay, panel, (view, scale) in zip(takes, overlays, panels, views, strict=True):
                panel[:] = view
                overlay.draw(panel, take.row(seconds), seconds, scale)
            add(picture)

        finished = finishing.submit(lambda: None)
        for seconds in times.tolist():
            views = [_view(*stages[take.conditions], film.camera, take, take.row(seconds)) for take in takes]
            finished.result()
            finished = finishing.submit(finish, views, seconds)
            if progress:
                progress(1 / len(times))
        finished.result()


def _filmed_insect(film: Film, conditions: Conditions) -> mujoco.MjModel:
    """The insect on its ground, with the looks and the buffer that a film needs."""
    model = compile_body(conditions).model
    model.vis.global_.offwidth, model.vis.global_.offheight = film.width, film.height
    if film.quality == "high":
        model.vis.quality.shadowsize, model.vis.quality.offsamples = 4096, 4
        return model
    model.vis.quality.offsamples = 0
    model.light_castshadow[:] = False
    if (i := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXTURE, GROUND)) >= 0:
        ground = model.texture(i)
        begin = int(ground.adr[0])
        colours = model.tex_data[begin : begin + int(ground.width[0] * ground.height[0] * ground.nchannel[0])]
        colours[:] = np.minimum(BRIGHTER * colours, 255)
    return model


def _view(
    renderer: "mujoco.Renderer", data: mujoco.MjData, camera: str, take: Take, row: int
) -> tuple[np.ndarray, float]:
    """The scene at the end of step `row`, (height, width, 3), and its pixels per mm at the centre of mass."""
    data.qpos[:] = take.qpos[row]
    mujoco.mj_kinematics(renderer.model, data)
    mujoco.mj_comPos(renderer.model, data)
    mujoco.mj_camlight(renderer.model, data)
    renderer.update_scene(data, camera)
    stable, body = bool(take.margin[row] > 0.0), take.conditions.body
    centre = take.centre_of_mass[row]
    corners, level = support_on_ground(take.conditions, take.feet[row], take.stance[row], centre)
    mark_support(renderer.scene, body.marks, corners, level, stable)
    mark_centre_of_mass(renderer.scene, body.marks, centre, level, stable)
    mark_planned_tips(renderer.scene, body.marks, take.planned_tip[row])
    return renderer.render(), _pixels_per_mm(renderer, centre)


def _pixels_per_mm(renderer: "mujoco.Renderer", point: np.ndarray) -> float:
    """Of a length across the view at a point, (3,) [mm]; 0 where that is not ahead of the camera."""
    camera = renderer.scene.camera[0]
    ahead = float(np.dot(point - camera.pos, camera.forward))
    if ahead <= camera.frustum_near:
        return 0.0
    at = camera.frustum_near if camera.orthographic else ahead
    return renderer.height * camera.frustum_near / ((camera.frustum_top - camera.frustum_bottom) * at)
