"""`hexmj render`, `hexmj page`, `hexmj export` and `hexmj view`."""

from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

from hexmj.cli.command import Answer, Command
from hexmj.cli.options import Output, Planning, Threads, build, conditions, controller
from hexmj.cli.output import show
from hexmj.command import Command as Twist
from hexmj.errors import InputError
from hexmj.timing import Stride

if TYPE_CHECKING:
    from hexmj.replay.recording import Recording, Start

END = "Press Ctrl-C to stop."


@dataclass(frozen=True)
class RenderOptions:
    """Options of `hexmj render` that `Start` and `Film` do not have."""

    recordings: tuple[Path, ...] = ()
    """Recordings (recording.nc of `hexmj walk`), shown side by side; without a recording, a physical walk is recorded
    first."""
    beside: str | None = None
    """Show beside the walk, from the same start: 'planned' (the plan with its support polygon) or the walk of a second
    controller, given by name."""
    format: Literal["mp4", "gif"] = "mp4"
    """Format of the video."""


class Render(Command):
    """Render a video of recordings, or of a physical walk that is recorded first."""

    sources = (RenderOptions, "replay.recording:Start", Output, "replay.video:Film", Planning, Threads)
    positional = "recordings"
    examples = ("results/walk/recording.nc --camera side", "--controller wilson --velocity 0.5 --beside planned")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.replay.recording import Start, load_recording, recording_summary, save_recording
        from hexmj.replay.video import Film, render

        film = build(Film, given)
        shown, settings, files = [load_recording(path) for path in given.recordings], None, list[Path]()
        if not shown:
            start = build(Start, given)
            shown = _recorded(start, given)
            files = [save_recording(walked, given.out / f"recording-{n}.nc") for n, walked in enumerate(shown, 1)]
            settings = start.settings(**{given.controller: start.controller}) | {"beside": given.beside}
        files.append(given.out / f"film.{given.format}")
        frames = render(shown, files[-1], film, progress=True)
        summary = {"frames": frames, "film": asdict(film), "recordings": [*map(recording_summary, shown)]}
        return Answer(summary, [f"{frames} frames at {film.fps:g} per second"], files, settings)


def _recorded(start: "Start", given: SimpleNamespace) -> "list[Recording]":
    """Record the walk, and the plan or the walk of the second controller that --beside asks for."""
    from hexmj.replay.recording import Start, record, record_plan

    second = controller(given, given.beside) if given.beside not in (None, "planned") else None
    name, walked = start.controller.name, start.walk(True, given.threads)
    shown = [record(walked, title=name)]
    if given.beside == "planned":
        return [record_plan(walked.planned, start.conditions, start.stride, title=f"{name}, planned"), *shown]
    if second:
        shown.append(build(Start, given, controller=second).recorded(True, second.name, given.threads))
    return shown


@dataclass(frozen=True)
class Recordings:
    """Options of `hexmj page` and `hexmj export`."""

    recordings: tuple[Path, ...]
    """Recordings (recording.nc of `hexmj walk`)."""


class Page(Command):
    """Write one HTML file that plays one recording, or two side by side, in 3D with footfall diagram and stability
    margin. The file works without a network."""

    sources = (Recordings, Output)
    positional = "recordings"
    examples = ("results/walk/recording.nc", "first/recording.nc second/recording.nc --out results/both")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.replay.page import page
        from hexmj.replay.recording import load_recording, recording_summary

        shown = [load_recording(path) for path in given.recordings]
        file = page(shown, given.out / "walk.html")
        line = f"{file.stat().st_size / 1e6:.1f} MB; open the file in any browser"
        return Answer({"recordings": [*map(recording_summary, shown)]}, [line], [file])


class Export(Command):
    """Export recordings as CSV tables with one row for each step of the plan: joint angles and torques, ground forces,
    contacts, tips, stability margins and the pose of the root."""

    sources = (Recordings, Output)
    positional = "recordings"
    examples = ("results/walk/recording.nc", "first/recording.nc second/recording.nc --out tables")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.replay.recording import load_recording

        if not given.recordings:
            raise InputError("no recording is given; `hexmj walk` writes one")
        stems = [path.stem for path in given.recordings]
        if len(set(stems)) < len(stems):  # such as recording.nc of several walks
            stems = [f"recording-{n}" for n in range(1, len(stems) + 1)]
        files = [given.out / f"{stem}.csv" for stem in stems]
        lines, tables = [], []
        for path, file in zip(given.recordings, files, strict=True):
            recording = load_recording(path)
            recording.to_csv(file)
            rows, columns = recording.to_dataframe().shape
            lines.append(f"{path}: {rows} rows, {columns} columns")
            tables.append({"recording": path, "rows": rows, "columns": columns})
        return Answer({"tables": tables}, lines, files)


@dataclass(frozen=True)
class ViewOptions:
    """Options of `hexmj view`."""

    recording: Path | None = None
    """A recording (recording.nc of `hexmj walk`); without one, an insect walks live."""
    browser: bool = False
    """Show the view in a browser even if there is a screen."""
    host: str = "127.0.0.1"
    """Address of the browser's page; with 0.0.0.0, other machines can also view and steer the insect."""
    port: int = 8080
    """Port of the browser's page; 0 chooses a free port."""


class View(Command):
    """View a walking insect or a recording: in MuJoCo's viewer if there is a screen, otherwise in a browser."""

    sources = (ViewOptions, "replay.recording:Start", Planning)
    hidden = ("observation_time", "stride", "acceleration")
    positional = "recording"
    examples = ("--velocity 0.5", "results/walk/recording.nc --browser --port 0")

    def run(self, given: SimpleNamespace) -> None:
        from hexmj.view.desktop import screen

        show_it = self.live if given.recording is None else self.recording
        show_it(given, screen() and not given.browser)

    def live(self, given: SimpleNamespace, desktop: bool) -> None:
        """Show an insect that walks until the window is closed or Ctrl-C is pressed."""
        from hexmj.progress import progress_bar
        from hexmj.starts import draw_start
        from hexmj.view.browser import check_port
        from hexmj.view.live import LiveWalk
        from hexmj.view.session import LiveSession

        def starts(number: int) -> Any:
            return draw_start(number, given.seed, Stride())[0]

        planned = controller(given, given.controller)
        if not desktop:
            check_port(given.host, given.port)  # raises before the insect settles
        with progress_bar("settling"):
            twist = Twist(given.velocity, given.left, given.turn)
            walk = LiveWalk(planned, twist, starts(given.start), conditions(given))
        session = LiveSession(walk, given.start, starts)
        if desktop:
            from hexmj.view.desktop import KEYS, view_live

            show(KEYS, END)
            view_live(session)
        else:
            from hexmj.view.browser import BrowserView

            view = BrowserView(session, given.host, given.port)
            show(f"{planned.name} walks at {view.address}", END)
            view.run()

    def recording(self, given: SimpleNamespace, desktop: bool) -> None:
        """Play a recording in an endless loop."""
        from hexmj.replay.recording import load_recording

        recording = load_recording(given.recording)
        if desktop:
            from hexmj.replay.take import Take
            from hexmj.view.desktop import PAUSE, view_recording

            show(PAUSE, END)
            view_recording(Take.of(recording))
        else:
            from hexmj.replay.page import page_text
            from hexmj.view.browser import page_server

            with page_server(page_text([recording]), given.host, given.port) as server:
                show(f"{given.recording} plays at http://{given.host}:{server.server_port}", END)
                server.serve_forever(poll_interval=0.1)
