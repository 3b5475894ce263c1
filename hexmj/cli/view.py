"""`hexmj view`."""

from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import OmitArgPrefixes, Positional

from hexmj.cli.options import Controlled, ControllerName
from hexmj.cli.registry import changed
from hexmj.cli.tables import show
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.progress import progress_bar

END = "Ctrl-C ends it."


@dataclass(frozen=True)
class View:
    """Options of `hexmj view`, which `commands.COMMANDS` describes."""

    recording: Positional[Path | None] = None
    """A recording (recording.nc of `hexmj walk`); none: an insect walks while you look, to which the options of walks
    belong."""
    model: ControllerName = "ldvs"
    velocity: float = 0.3
    """Velocity V_r as a fraction of V_p, 0 <= V < 1, to begin with."""
    seed: int = 0
    """Seed of the random starts."""
    start: int = 0
    """Which of them comes first."""
    browser: bool = False
    """Look in a browser although there is a screen."""
    host: str = "127.0.0.1"
    """At which the browser's page is served; 0.0.0.0 lets other machines look, too, and steer."""
    port: int = 8080
    """At which the browser's page is served; 0 takes any."""
    controlled: OmitArgPrefixes[Controlled] = field(default_factory=Controlled)
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)

    def run(self) -> None:
        """Look at the recording or the walk, until the observation time is closed or somebody stops it."""
        from hexmj.view.desktop import screen

        on_screen = screen() and not self.browser
        if on_screen and (names := [name for name in changed(self, View()) if name in ("host", "port")]):
            raise InputError(f"--{names[0]} was given where there is a screen; expected it with --browser")
        if self.recording is None:
            self._view_walk(on_screen)
        else:
            self._view_recording(self.recording, on_screen)

    def _view_walk(self, on_screen: bool) -> None:
        """An insect that walks until somebody stops it."""
        from hexmj.starts import draw_start
        from hexmj.timing import Stride
        from hexmj.view.live import LiveWalk
        from hexmj.view.port import check_port
        from hexmj.view.session import LiveSession

        def starts(number: int):
            return draw_start(number, self.seed, Stride())[0]

        controller = self.controlled.controller(self.model)
        if not on_screen:
            check_port(self.host, self.port)  # before the insect settles
        with progress_bar("settling"):
            walk = LiveWalk(controller, self.velocity, starts(self.start), self.conditions)
        session = LiveSession(walk, self.start, starts)
        if on_screen:
            from hexmj.view.desktop import KEYS, view_live

            show(KEYS, END)
            view_live(session)
        else:
            from hexmj.view.browser import BrowserView

            view = BrowserView(session, self.host, self.port)
            show(f"{controller.name} walks at {view.address}", END)
            view.run()

    def _view_recording(self, path: Path, on_screen: bool) -> None:
        """A recording, again and again."""
        from hexmj.replay.page.page import page_text
        from hexmj.replay.recording import load_recording
        from hexmj.replay.take import Take

        obeyed = View(recording=path, browser=self.browser, host=self.host, port=self.port)
        if names := list(changed(self, obeyed)):
            name = names[0].replace("_", "-")
            raise InputError(f"--{name} was given with a recording; expected it only where an insect walks")
        recording = load_recording(path)
        if on_screen:
            from hexmj.view.desktop import PAUSE, view_recording
            from hexmj.view.session import ReplaySession

            show(PAUSE, END)
            view_recording(ReplaySession(Take.of(recording)))
            return
        from hexmj.view.served import page_server

        with page_server(page_text([recording]), self.host, self.port) as server:
            show(f"{path} plays at http://{self.host}:{server.server_port}", END)
            server.serve_forever(poll_interval=0.1)
