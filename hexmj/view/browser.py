"""View of a live walk in a browser with viser (insect, controls, margin, footfall), and a server of one HTML page."""

import io
import logging
import socket
from collections import deque
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import asdict, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import SimpleQueue
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.mjcf import compile_body
from hexmj.command import Command
from hexmj.controllers.cruse1998 import Cruse1998, Symmetric
from hexmj.errors import InputError, without_extra
from hexmj.legs import LEGS
from hexmj.plotting import MEASURE_STYLES
from hexmj.rendering.scene_marks import CENTRE, STABLE, TIP, UNSTABLE
from hexmj.rendering.shapes import body_shapes, ground_shape
from hexmj.replay.take import margin_in_words, support_on_ground
from hexmj.validate import whole
from hexmj.view.live import LiveWalk, Moment
from hexmj.view.session import IMPULSE, LiveSession, ticks
from hexmj.walks import footfall_html

CHART_INTERVAL = 6
"""Number of frames from one update of the charts to the next."""

CHARTED = 2.0
"""Length of the time that the charts show [s]."""

RANGES = {
    "p1_i": (0.0, 20.0), "p1_c": (0.0, 20.0), "p31_i": (-20.0, 20.0), "p32_i": (0.0, 20.0), "p33_i": (0.0, 2.0),
    "p34_i": (-20.0, 40.0), "p31_c": (-20.0, 20.0), "p32_c": (0.0, 2.0),
}  # fmt: skip
"""Ranges of the sliders of symmetric weights, wide enough for both published weight sets."""

COMMAND = {
    "forward": (0.95, 0.01, "velocity forward [V_p]"),
    "left": (0.5, 0.01, "velocity to the left [V_p]"),
    "turn": (0.02, 0.0005, "yaw rate, counterclockwise [rad / time unit]"),
}
"""Slider of the command -> its maximum, step and hint."""

SWITCHES = ("p2", "p4_i")
"""Weights that are on (1) or off (0), and have check boxes instead of sliders."""


def check_port(host: str, port: int) -> None:
    """Raise InputError if no server can listen at the host and port; port 0 means any free port."""
    whole("port", port, 0, 65535)
    try:
        socket.create_server((host, port)).close()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"host = {host}, port = {port}: {reason}; expected a free port of this machine") from None


def page_server(text: str, host: str, port: int) -> ThreadingHTTPServer:
    """Return a server of one HTML page; call its `serve_forever` to serve the page.

    Raises:
        InputError: the address is not free.
    """
    check_port(host, port)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            content = text.encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Do not log requests."""

    return ThreadingHTTPServer((host, port), Handler)


class BrowserView:
    """A viser server that shows a live walk.

    Attributes:
        address: URL of the page.
        controls: name -> viser's handle of a slider or check box that changes the walk.
        server: viser's server.
    """

    def __init__(self, session: LiveSession, host: str = "127.0.0.1", port: int = 8080) -> None:
        """Start the server; port 0 chooses any free port.

        Raises:
            InputError: viser is missing, or the address is not free.
        """
        try:
            import viser
        except ImportError:
            raise without_extra("view", "viser") from None
        check_port(host, port)
        self.session, self._changes = session, SimpleQueue[Callable[[], object]]()
        self.controls: dict[str, Any] = {}
        logging.getLogger("websockets.server").addFilter(lambda entry: entry.msg != "opening handshake failed")
        with redirect_stdout(io.StringIO()):  # viser prints the address
            self.server = server = viser.ViserServer(host=host, port=port, label="hexmj", verbose=False)
        self.address = f"http://{host}:{server.get_port()}"
        server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        server.initial_camera.position, server.initial_camera.look_at = (-45.0, -85.0, 55.0), (5.0, 0.0, 0.0)
        self._recent: deque[Moment] = deque()
        self._make_scene()
        self._make_controls()
        self._make_charts()

    def run(self) -> None:
        """Advance and show the walk in real time until the process is interrupted."""
        try:
            for n, passed in enumerate(ticks()):
                self.step(passed, n % CHART_INTERVAL == 0)
        finally:
            with redirect_stdout(io.StringIO()):
                self.server.stop()

    def step(self, passed: float, charts: bool = True) -> None:
        """Apply changes from the controls, advance the walk by `passed` [s], and show it (charts only if `charts`)."""
        while not self._changes.empty():
            self.session.attempt(self._changes.get())
        moment = self.session.tick(passed)
        if self.session.walk.conditions != self._shown_conditions:
            self._make_scene()
        self._recent.extend(self.session.walk.trace)
        while self._recent and not moment.seconds - CHARTED <= self._recent[0].seconds <= moment.seconds:
            self._recent.popleft()  # too old, or from before a restart of the walk
        with self.server.atomic():
            self._show(moment)
            if charts:
                self._show_charts(moment)

    def _change(self, change: Callable[[LiveWalk], object]) -> None:
        """Queue a change of the walk until the next `step`, because viser calls this method from its own threads."""
        self._changes.put(lambda: change(self.session.walk))

    def _make_controls(self) -> None:
        gui, walk = self.server.gui, self.session.walk
        self._readout = gui.add_markdown("")
        with gui.add_folder("Walk"):
            now, found = walk.conditions.vp, walk.command.parts[0]
            for (name, (most, step, hint)), value in zip(COMMAND.items(), found.tolist(), strict=True):
                most = max(most, abs(value))
                self.controls[name] = gui.add_slider(name, -most, most, step, value, hint=hint)
                self.controls[name].on_update(lambda _: self._change(self._steer))
            gui.add_button("Halt").on_click(lambda _: self._halt())
            vp = gui.add_slider("V_p [mm/s]", min(20, now), max(400, now), 5, now, hint="restarts the walk")
            vp.on_update(
                lambda _: self._change(lambda walk: walk.begin(conditions=replace(walk.conditions, vp=float(vp.value))))
            )
            self.controls["V_p"] = vp
            speed = gui.add_slider("speed", 0.0, 1.0, 0.1, 1.0, hint="fraction of real time; 0 pauses")
            speed.on_update(lambda _: setattr(self.session, "speed", float(speed.value)))
            restarts = {"same start": self.session.begin, "next start": self.session.begin_next}
            buttons = gui.add_button_group("", tuple(restarts))
            buttons.on_click(lambda _: self._change(lambda _: restarts[buttons.value]()))
        with gui.add_folder("Push"):
            impulse = gui.add_slider("impulse", -60.0, 60.0, 1.0, IMPULSE, hint="to the left [m V_p]")
            gui.add_button("Push").on_click(lambda _: self._change(lambda walk: walk.push(float(impulse.value))))
        controller = walk.controller
        if isinstance(controller, Cruse1998) and isinstance(controller.weights, Symmetric):
            with gui.add_folder("Weights of the network", expand_by_default=False):
                self._make_weights(controller, controller.weights)

    def _steer(self, walk: LiveWalk) -> None:
        """Let the walk follow the sliders of the command."""
        forward, left, turn = (float(self.controls[name].value) for name in COMMAND)
        walk.steer(Command(forward, left, turn))

    def _halt(self) -> None:
        for name in COMMAND:
            self.controls[name].value = 0.0
        self._change(self._steer)

    def _make_weights(self, controller: Cruse1998, weights: Symmetric) -> None:
        gui, handles = self.server.gui, {}
        for name, value in asdict(weights).items():
            if name in SWITCHES:
                handles[name] = gui.add_checkbox(name, bool(value))
            else:
                least, most = RANGES[name]
                handles[name] = gui.add_slider(name, min(least, value), max(most, value), 0.001, value)

        def changed(_: Any) -> None:
            weights = Symmetric(**{name: float(handle.value) for name, handle in handles.items()})
            self._change(lambda walk: walk.steer(controller=replace(controller, weights=weights)))

        self.controls |= handles
        for handle in handles.values():
            handle.on_update(changed)

    def _make_scene(self) -> None:
        """Add body, ground and marks. The centre of mass keeps its horizontal place, and the ground moves below it."""
        scene, conditions = self.server.scene, self.session.walk.conditions
        self._shown_conditions, compiled = conditions, compile_body(conditions)
        self._model, self._data = compiled.model, mujoco.MjData(compiled.model)
        scene.reset()
        self._ground = scene.add_frame("/ground", show_axes=False)
        plane = float(self._model.geom(conditions.body.ground).pos[2])
        grid: Any = {"cell_size": 10.0, "section_size": 50.0, "infinite_grid": True, "fade_distance": 700.0}
        scene.add_grid(
            "/ground/plane", position=(0.0, 0.0, plane), plane_opacity=0.5, plane_color=(225, 225, 220), **grid
        )
        ground, self._frames = ground_shape(compiled), {}
        if len(ground.faces):
            scene.add_mesh_simple("/ground/shape", ground.corners, ground.faces, color=(190, 196, 200), side="double")
        for n, part in enumerate(body_shapes(self._model)):
            body, colour = int(part.body[0]), tuple(part.colour[0].tolist())
            if body not in self._frames:
                self._frames[body] = scene.add_frame(f"/body_{body}", show_axes=False)
            scene.add_mesh_simple(f"/body_{body}/part_{n}", part.corners, part.faces, color=colour, side="double")
        marks, fan = conditions.body.marks, np.array([(0, i, i + 1) for i in range(1, 5)])
        self._polygon = scene.add_mesh_simple(
            "/polygon", np.zeros((6, 3)), fan, color=STABLE, opacity=0.45, side="double", cast_shadow=False
        )
        segments, colours = np.zeros((6, 2, 3)), {True: STABLE, False: UNSTABLE}
        self._outlines = {
            stable: scene.add_line_segments(f"/outline_{stable}", segments, colour, thickness=2 * marks.outline)
            for stable, colour in colours.items()
        }
        self._plumb = scene.add_line_segments("/plumb", np.zeros((1, 2, 3)), CENTRE, thickness=marks.outline)
        self._centre = scene.add_icosphere("/centre", marks.centre[0], CENTRE)
        sphere: Any = {"subdivisions": 1, "cast_shadow": False}
        self._planned = [
            scene.add_icosphere(f"/planned_{leg}", marks.tip, TIP, wireframe=True, **sphere) for leg in LEGS
        ]
        self._labels = [scene.add_label(f"/label_{leg}", leg) for leg in LEGS]

    def _show(self, moment: Moment) -> None:
        """Place body, ground and marks; the origin is the point at height 0 below the centre of mass."""
        centre = moment.centre_of_mass
        origin = np.array([*centre[:2], 0.0])
        self._data.qpos[:] = moment.qpos
        mujoco.mj_kinematics(self._model, self._data)
        for body, frame in self._frames.items():
            frame.position, frame.wxyz = self._data.xpos[body] - origin, self._data.xquat[body].copy()
        polygon, level = support_on_ground(self.session.walk.conditions, moment.feet[:, :2], moment.stance, centre)
        self._ground.position = -origin
        corners = np.column_stack([polygon, np.full(len(polygon), level + 0.3)]) - origin
        padded = corners[np.minimum(np.arange(6), len(corners) - 1)] if len(corners) else np.zeros((6, 3))
        edges = np.stack([padded, np.roll(padded, -1, axis=0)], axis=1)
        self._polygon.visible = moment.margin > 0
        self._polygon.vertices = padded.astype(np.float32)
        for stable, outline in self._outlines.items():
            outline.visible, outline.points = stable == (moment.margin > 0), edges.astype(np.float32)
        foot = np.array([0.0, 0.0, level])
        self._plumb.points = np.stack([centre - origin, foot])[np.newaxis].astype(np.float32)
        self._centre.position = foot
        for leg, name in enumerate(LEGS):
            self._planned[leg].position = moment.planned_tips[leg] - origin
            self._labels[leg].position = moment.feet[leg] - origin + (0.0, 0.0, 3.0)
            self._labels[leg].text = name if moment.stance[leg] else f"({name})"

    def _make_charts(self) -> None:
        from viser import uplot

        series = (
            uplot.Series(label="time [s]"),
            uplot.Series(label="grounded", stroke=MEASURE_STYLES["grounded"]["color"], width=2),
            uplot.Series(label="planned", stroke=MEASURE_STYLES["kinematic"]["color"], width=1, dash=(4, 3)),
        )
        options: Any = {"scales": {"x": uplot.Scale(time=False)}, "aspect": 2.2}
        gui = self.server.gui
        self._margins = gui.add_uplot((np.zeros(1),) * 3, series, title="stability margin [mm]", **options)
        self._footfall = gui.add_html("")

    def _show_charts(self, moment: Moment) -> None:
        session, walk, stable = self.session, self.session.walk, moment.margin > 0
        state = f"{'within' if stable else 'outside'} the polygon"
        sign = "\N{HEAVY CHECK MARK}" if stable and not walk.fell_on else "\N{HEAVY MULTIPLICATION X}"
        self._readout.content = (
            f"**{margin_in_words(moment.margin)}** {sign} {state}\n\nV = {moment.velocity:.2f}, {moment.seconds:.2f} s,"
            f" start {session.start}{', ' * bool(walk.loss_in_words)}{walk.loss_in_words}\n\n_{session.message}_"
        ).removesuffix("\n\n__")
        if len(self._recent) < 2:
            return
        shown = list(self._recent)[:: max(1, len(self._recent) // 400)]
        seconds = np.array([moment.seconds for moment in shown])
        margins = (np.array([getattr(moment, name) for moment in shown]) for name in ("margin", "planned_margin"))
        self._margins.data = (seconds, *(np.where(np.isfinite(margin), margin, np.nan) for margin in margins))
        swings, vp = ~np.array([moment.stance for moment in shown]), walk.conditions.vp
        self._footfall.content = footfall_html("", seconds * vp, swings, "", 340)
