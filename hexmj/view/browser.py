"""A live walk in a browser, by viser: the insect, its polygon, sliders, margin and footfall."""

import io
import logging
from collections import deque
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import asdict, replace
from itertools import takewhile
from queue import SimpleQueue
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.mjcf import compile_body
from hexmj.controllers.cruse1998 import Cruse1998, Symmetric
from hexmj.errors import without_extra
from hexmj.legs import LEGS
from hexmj.rendering.scene_marks import CENTRE, STABLE, TIP, UNSTABLE
from hexmj.rendering.shapes import body_shape, ground_shape
from hexmj.replay.take import support_on_ground
from hexmj.view.charts import CHARTED, footfall, readout
from hexmj.view.live import LiveWalk, Moment
from hexmj.view.port import check_port
from hexmj.view.session import IMPULSE, LiveSession, ticks

CHARTS = 6
"""A chart is drawn with every so many pictures."""

RANGES = {
    "p1_i": (0.0, 20.0), "p1_c": (0.0, 20.0), "p31_i": (-20.0, 20.0), "p32_i": (0.0, 20.0), "p33_i": (0.0, 2.0),
    "p34_i": (-20.0, 40.0), "p31_c": (-20.0, 20.0), "p32_c": (0.0, 2.0),
}  # fmt: skip
"""Sliders of the symmetric weights, wide enough for both published sets; the two that are on or off have boxes."""

SWITCHES = ("p2", "p4_i")

MEASURED, PLANNED = "#c8740a", "#1b6ca8"


def is_of_walking(record: logging.LogRecord) -> bool:
    """Whether a complaint of the server is more than that somebody hung up, or asked for what is no page."""
    return record.msg != "opening handshake failed"


class BrowserView:
    """A server, and what it shows."""

    address: str
    """Where a browser finds it."""
    controls: dict[str, Any]
    """viser's handles of the sliders and boxes that change what is walked, by their names."""

    def __init__(self, session: LiveSession, host: str = "127.0.0.1", port: int = 8080) -> None:
        """Serve; port 0 takes any.

        Raises:
            InputError: viser is missing, or the port is taken.
        """
        try:
            import viser
        except ImportError:
            raise without_extra("view", "viser, which shows a walk in a browser,") from None
        check_port(host, port)
        self.session, self._wishes = session, SimpleQueue[Callable[[], object]]()
        logging.getLogger("websockets.server").addFilter(is_of_walking)
        with redirect_stdout(io.StringIO()):  # the address is told by who asked for it
            self.server = server = viser.ViserServer(host=host, port=port, label="hexmj", verbose=False)
        self.address = f"http://{host}:{server.get_port()}"
        server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        server.initial_camera.position, server.initial_camera.look_at = (-45.0, -85.0, 55.0), (5.0, 0.0, 0.0)
        self._recent: deque[Moment] = deque()
        self._lay()
        self._make_controls()
        self._make_charts()

    def run(self, go_on: Callable[[], bool] = lambda: True) -> None:
        """Walk and show until `go_on` says no."""
        try:
            for n, passed in enumerate(takewhile(lambda _: go_on(), ticks())):
                self.step(passed, n % CHARTS == 0)
        finally:
            with redirect_stdout(io.StringIO()):
                self.server.stop()

    def step(self, passed: float, charts: bool = True) -> None:
        """Do what was wished for, let so many seconds pass, and show what is seen then."""
        while not self._wishes.empty():
            self.session.attempt(self._wishes.get())
        moment = self.session.tick(passed)
        if self.session.walk.conditions != self._laid:
            self._lay()
        self._recent.extend(self.session.walk.trace)
        while self._recent and not moment.seconds - CHARTED <= self._recent[0].seconds <= moment.seconds:
            self._recent.popleft()  # past, or of a walk before this one
        with self.server.atomic():
            self._show(moment)
            if charts:
                self._show_charts(moment)

    # ---- what is done to the walk ----

    def _wish(self, change: Callable[[LiveWalk], object]) -> None:
        """Have something done to the walk between two pictures: callbacks run in threads of their own."""
        self._wishes.put(lambda: change(self.session.walk))

    def _make_controls(self) -> None:
        gui, walk = self.server.gui, self.session.walk
        self.controls = {}
        self._readout = gui.add_markdown("")
        with gui.add_folder("Walk"):
            v = walk.velocity
            velocity = gui.add_slider("V", 0.0, max(0.95, v), 0.01, v, hint="from the next step on")
            velocity.on_update(lambda _: self._wish(lambda walk: walk.steer(velocity=velocity.value)))
            now = walk.conditions.vp
            vp = gui.add_slider("V_p [mm/s]", min(20, now), max(400, now), 5, now, hint="the walk begins again")
            vp.on_update(
                lambda _: self._wish(lambda walk: walk.begin(conditions=replace(walk.conditions, vp=float(vp.value))))
            )
            self.controls |= {"V": velocity, "V_p": vp}
            paused = gui.add_checkbox("pause", False)
            paused.on_update(lambda _: setattr(self.session, "paused", paused.value))
            begins = {"same start": self.session.begin, "next start": self.session.begin_next}
            buttons = gui.add_button_group("", tuple(begins))
            buttons.on_click(lambda _: self._wish(lambda _: begins[buttons.value]()))
        with gui.add_folder("Push"):
            impulse = gui.add_slider("to the left [m V_p]", -60.0, 60.0, 1.0, IMPULSE)
            gui.add_button("Push").on_click(lambda _: self._wish(lambda walk: walk.push(float(impulse.value))))
        controller = walk.controller
        if isinstance(controller, Cruse1998) and isinstance(controller.weights, Symmetric):
            with gui.add_folder("Weights of the network, from the next step on", expand_by_default=False):
                self._make_weights(controller, controller.weights)

    def _make_weights(self, controller: Cruse1998, weights: Symmetric) -> None:
        gui, handles = self.server.gui, {}
        for name, value in asdict(weights).items():
            if name in SWITCHES:
                handles[name] = gui.add_checkbox(name, bool(value))
            else:
                least, most = RANGES[name]
                handles[name] = gui.add_slider(name, min(least, value), max(most, value), 0.001, value)

        def changed(_: Any) -> None:
            now = Symmetric(**{name: float(handle.value) for name, handle in handles.items()})
            self._wish(lambda walk: walk.steer(controller=replace(controller, weights=now)))

        self.controls |= handles
        for handle in handles.values():
            handle.on_update(changed)

    # ---- what is seen ----

    def _lay(self) -> None:
        """Put body and ground there, under the conditions of now; the ground moves below a centre that stays."""
        scene, conditions = self.server.scene, self.session.walk.conditions
        self._laid, compiled = conditions, compile_body(conditions)
        self._model, self._data = compiled.model, mujoco.MjData(compiled.model)
        scene.reset()
        self._ground = scene.add_frame("/ground", show_axes=False)
        plane = float(self._model.geom(conditions.body.ground).pos[2])
        grid: Any = {"cell_size": 10.0, "section_size": 50.0, "infinite_grid": True, "fade_distance": 700.0}
        scene.add_grid(
            "/ground/plane", position=(0.0, 0.0, plane), plane_opacity=0.5, plane_color=(225, 225, 220), **grid
        )
        ground, seen = ground_shape(compiled), body_shape(self._model)
        if len(ground.faces):
            scene.add_mesh_simple("/ground/laid", ground.corners, ground.faces, color=(190, 196, 200), side="double")
        self._frames = {}
        for body in np.unique(seen.body):
            name = f"/body_{body}"
            self._frames[body] = scene.add_frame(name, show_axes=False)
            for k, colour in enumerate(np.unique(seen.colour[seen.body == body], axis=0)):
                here = (seen.body == body) & (seen.colour == colour).all(axis=1)
                faces = np.cumsum(here)[seen.faces[here[seen.faces].all(axis=1)]] - 1
                scene.add_mesh_simple(f"{name}/part_{k}", seen.corners[here], faces, color=tuple(colour), side="double")
        self._add_marks(conditions.body.marks)

    def _add_marks(self, marks: Any) -> None:
        scene, fan = self.server.scene, np.array([(0, i, i + 1) for i in range(1, 5)])
        self._polygons = [
            scene.add_mesh_simple(f"/polygon_{name}", np.zeros((6, 3)), fan, color=colour, opacity=opacity,
                                  wireframe=wireframe, side="double", cast_shadow=False)
            for name, colour, opacity, wireframe in (("stable", STABLE, 0.45, False), ("lost", UNSTABLE, 1.0, True))
        ]  # fmt: skip
        segments = np.zeros((6, 2, 3))
        self._outlines = [
            scene.add_line_segments(f"/outline_{name}", segments, colour, thickness=2 * marks.outline)
            for name, colour in (("stable", STABLE), ("lost", UNSTABLE))
        ]
        self._plumb = scene.add_line_segments("/plumb", np.zeros((1, 2, 3)), CENTRE, thickness=marks.outline)
        self._centre = scene.add_icosphere("/centre", marks.centre[0], CENTRE)
        sphere: Any = {"subdivisions": 1, "cast_shadow": False}
        self._planned = [
            scene.add_icosphere(f"/planned_{one}", marks.tip, TIP, wireframe=True, **sphere) for one in LEGS
        ]
        self._labels = [scene.add_label(f"/label_{one}", one) for one in LEGS]

    def _show(self, moment: Moment) -> None:
        """Put everything where it is, seen from the ground below the centre of mass."""
        centre = moment.centre_of_mass
        here = np.array([*centre[:2], 0.0])
        self._data.qpos[:] = moment.qpos
        mujoco.mj_kinematics(self._model, self._data)
        for body, frame in self._frames.items():
            frame.position, frame.wxyz = self._data.xpos[body] - here, self._data.xquat[body].copy()
        polygon, level = support_on_ground(self.session.walk.conditions, moment.feet[:, :2], moment.stance, centre)
        self._ground.position = -here
        corners = np.column_stack([polygon, np.full(len(polygon), level + 0.3)]) - here
        padded = corners[np.minimum(np.arange(6), len(corners) - 1)] if len(corners) else np.zeros((6, 3))
        edges = np.stack([padded, np.roll(padded, -1, axis=0)], axis=1)
        stable = moment.margin > 0
        for shown, fill, outline in zip((stable, not stable), self._polygons, self._outlines, strict=True):
            fill.visible = outline.visible = shown
            fill.vertices, outline.points = padded.astype(np.float32), edges.astype(np.float32)
        foot = np.array([0.0, 0.0, level])
        self._plumb.points = np.stack([centre - here, foot])[np.newaxis].astype(np.float32)
        self._centre.position = foot
        for leg, name in enumerate(LEGS):
            self._planned[leg].position = moment.planned_tips[leg] - here
            self._labels[leg].position = moment.feet[leg] - here + (0.0, 0.0, 3.0)
            self._labels[leg].text = name if moment.stance[leg] else f"({name})"

    def _make_charts(self) -> None:
        from viser import uplot

        time_axis = uplot.Series(label="s")
        empty = np.zeros(1)
        lines = (
            uplot.Series(label="measured", stroke=MEASURED, width=2),
            uplot.Series(label="planned", stroke=PLANNED, width=1, dash=(4, 3)),
        )
        how: Any = {"scales": {"x": uplot.Scale(time=False)}, "aspect": 2.2}
        gui = self.server.gui
        self._margins = gui.add_uplot((empty,) * 3, (time_axis, *lines), title="stability margin [mm]", **how)
        self._footfall = gui.add_html("")

    def _show_charts(self, moment: Moment) -> None:
        self._readout.content = readout(self.session, moment)
        if len(self._recent) < 2:
            return
        seen = list(self._recent)[:: max(1, len(self._recent) // 400)]
        seconds = np.array([one.seconds for one in seen])
        margins = (np.array([getattr(one, name) for one in seen]) for name in ("margin", "planned_margin"))
        self._margins.data = (seconds, *(np.where(np.isfinite(one), one, np.nan) for one in margins))
        self._footfall.content = footfall(seconds, ~np.array([one.stance for one in seen]))
