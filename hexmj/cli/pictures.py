"""`hexmj render`, `hexmj page`, `hexmj export` and `hexmj view`."""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

from hexmj import command
from hexmj.cli.command import Answer, Command
from hexmj.cli.measures import PHYSICAL
from hexmj.cli.options import Output, Planning, Threads, build, controller, no_effect
from hexmj.cli.output import show, table
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, RenderingError
from hexmj.replay.film import MOST_PANELS, Film
from hexmj.timing import Stride

if TYPE_CHECKING:
    from hexmj.replay.recording import Recording, Start

WALKS: dict[str, Any] = {"controller": "ldvs", "velocity": 0.3, "left": 0.0, "turn": 0.0, "seed": 0, "start": 0}
"""Option that has no effect on recordings -> its default."""

END = "Press Ctrl-C to stop."


@dataclass(frozen=True)
class RenderOptions:
    """Options of `hexmj render` that `Start` and `Film` do not have."""

    recordings: tuple[Path, ...] = ()
    """One to six recordings (recording.nc of `hexmj walk`), shown side by side; without a recording, a physical walk is
    recorded first."""
    out: Path = Path("results/render")
    """Folder for the video and new recordings."""
    beside: str | None = None
    """Show beside the walk, from the same start: 'planned' (the plan with its support polygon) or the walk of a second
    controller, given by name."""
    format: Literal["mp4", "gif"] = "mp4"
    """Format of the video."""


class Render(Command):
    """Render a video of recordings, or of a physical walk that is recorded first."""

    sources = (RenderOptions, "replay.recording:Start", Output, Film, Planning, Threads)
    positional = "recordings"
    examples = ("results/walk/recording.nc --camera side", "--controller wilson --velocity 0.5 --beside planned")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.io import MANIFEST, results_folder
        from hexmj.rendering.gl import missing
        from hexmj.replay.recording import Start, load_recording, recording_summary, save_recording
        from hexmj.replay.video import render

        film = build(Film, given)
        film.check_format(given.format)
        if len(given.recordings) > MOST_PANELS:
            raise InputError(f"{len(given.recordings)} recordings; expected 1 to {MOST_PANELS}")
        if given.recordings:
            no_effect(given, [*WALKS, "beside", "feedback", *PHYSICAL], "on recordings", WALKS | {"beside": None})
        shown = [load_recording(path) for path in given.recordings]
        start = None if shown else build(Start, given)
        if start and given.beside not in (None, "planned"):
            controller(given, given.beside)  # raises for an unknown name before the walk
        out = results_folder(given.out)
        if reason := missing():
            raise RenderingError(reason)
        settings: dict[str, Any] = {"film": asdict(film)}
        files: list[Path] = []
        name = _file_name(given, film, [walked.attrs["title"] for walked in shown])
        if start:
            shown = _recorded(start, given)
            files = [save_recording(walked, out / f"{name}-{n}.nc") for n, walked in enumerate(shown, 1)]
            settings |= start.settings(**{given.controller: start.controller}) | {"beside": given.beside}
        video = out / f"{name}.{given.format}"
        frames = render(shown, video, film, progress=True)
        summary = {"frames": frames, "film": asdict(film), "recordings": [*map(recording_summary, shown)]}
        line = f"{frames} frames at {film.fps:g} per second"
        return Answer(summary, [line], [*files, video], settings, f"{video.name}-{MANIFEST}")


def _recorded(start: "Start", given: SimpleNamespace) -> "list[Recording]":
    """Record the walk, and the plan or the walk of the second controller that --beside asks for."""
    from hexmj.replay.recording import Start, record, record_plan

    name, walked = start.controller.name, start.walked(given.threads)
    shown = [record(walked, title=name)]
    if given.beside == "planned":
        return [record_plan(walked.planned, start.conditions, start.stride, title=f"{name}, planned"), *shown]
    if given.beside:
        second = build(Start, given, controller=controller(given, given.beside))
        shown.append(second.recorded(True, second.controller.name, given.threads))
    return shown


def _file_name(given: SimpleNamespace, film: Film, titles: Sequence[str]) -> str:
    """Return the name of the video's file without its suffix, made from the titles of its recordings and the camera."""
    titles = titles or [f"{given.controller} V {given.velocity:g}", given.beside or ""]
    camera = "" if film.camera == Film.camera else f" {film.camera}"
    words = " beside ".join(filter(None, titles))[:120] + camera
    return re.sub(r"[^A-Za-z0-9.+-]+", "-", words).strip(".-") or "film"


@dataclass(frozen=True)
class PageOptions:
    """Options of `hexmj page`."""

    recordings: tuple[Path, ...] = ()
    """One recording (recording.nc of `hexmj walk`), or two that play side by side at the same time."""
    out: Path = Path("results/page")
    """Folder for the page."""


class Page(Command):
    """Write one HTML file that plays one recording, or two side by side, in 3D with footfall diagram and stability
    margin. The file works without a network."""

    sources = (PageOptions, Output)
    positional = "recordings"
    examples = ("results/walk/recording.nc", "first/recording.nc second/recording.nc --out results/both")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.io import MANIFEST, results_folder
        from hexmj.replay.page import page
        from hexmj.replay.recording import load_recording, recording_summary

        if not 1 <= len(given.recordings) <= 2:
            raise InputError(f"{len(given.recordings)} recordings; expected 1 or 2, as `hexmj walk` writes them")
        shown = [load_recording(path) for path in given.recordings]
        file = page(shown, results_folder(given.out) / "walk.html")
        settings = {"recordings": [str(path) for path in given.recordings]}
        line = f"{file.stat().st_size / 1e6:.1f} MB; open the file in any browser"
        summary = {"recordings": [*map(recording_summary, shown)]}
        return Answer(summary, [line], [file], settings, f"{file.name}-{MANIFEST}")


@dataclass(frozen=True)
class ExportOptions:
    """Options of `hexmj export`."""

    recordings: tuple[Path, ...] = ()
    """One or more recordings (recording.nc of `hexmj walk`)."""
    csv: bool = False
    """Write the table of each recording as CSV. Without this option, the command lists the columns of the table."""
    out: Path | None = None
    """Folder for the CSV files; by default each file is beside its recording."""


class Export(Command):
    """Export recordings as tables with one row for each step of the plan: joint angles and torques, ground forces,
    contacts, tips, stability margins and the pose of the root."""

    sources = (ExportOptions, Output)
    positional = "recordings"
    examples = ("results/walk/recording.nc", "results/walk/recording.nc --csv")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.io import results_folder
        from hexmj.replay.recording import load_recording

        if not given.recordings:
            raise InputError("no recordings; expected one or more, as `hexmj walk` writes them")
        if not given.csv:
            no_effect(given, ["out"], "without --csv", {"out": None})
        recordings = [load_recording(path) for path in given.recordings]
        out = given.out and results_folder(given.out)
        files = [(out or path.parent) / f"{path.stem}.csv" for path in given.recordings] if given.csv else []
        if len(set(files)) < len(files):
            raise InputError("two recordings would be written to the same file; expected distinct file names")
        for file, recording in zip(files, recordings, strict=given.csv):
            recording.to_csv(file)
        lines, tables = [], []
        for path, recording in zip(given.recordings, recordings, strict=True):
            columns, rows = [(name, *about[:2]) for name, about in recording.columns().items()], recording.sizes["step"]
            lines.append(f"{path}: {rows} rows, {len(columns)} columns")
            lines += [] if given.csv else [table(("name", "unit", "meaning"), columns)]
            tables.append({"recording": path, "rows": rows, "columns": columns})
        return Answer({"tables": tables}, lines, files)


@dataclass(frozen=True)
class ViewOptions:
    """Options of `hexmj view`."""

    controller: Controller
    recording: Path | None = None
    """A recording (recording.nc of `hexmj walk`); without one, an insect walks live."""
    velocity: float = 0.3
    """Velocity forward at the beginning, as a fraction of V_p."""
    left: float = 0.0
    """Velocity to the left at the beginning, as a fraction of V_p."""
    turn: float = 0.0
    """Yaw rate at the beginning [rad / time unit]."""
    seed: int = 0
    """Seed of the random starts."""
    start: int = 0
    """Number of the first start among the random starts of the seed."""
    browser: bool = False
    """Show the view in a browser even if there is a screen."""
    host: str = "127.0.0.1"
    """Address of the browser's page; with 0.0.0.0, other machines can also view and steer the insect."""
    port: int = 8080
    """Port of the browser's page; 0 chooses a free port."""
    conditions: Conditions = Conditions()


class View(Command):
    """View a walking insect or a recording: in MuJoCo's viewer if there is a screen, otherwise in a browser."""

    sources = (ViewOptions, Planning)
    positional = "recording"
    examples = ("--velocity 0.5", "results/walk/recording.nc --browser --port 0")

    def run(self, given: SimpleNamespace) -> None:
        from hexmj.view.desktop import screen

        desktop = screen() and not given.browser
        if given.recording is None:
            self.live(given, desktop)
        else:
            no_effect(given, [*WALKS, "feedback", *PHYSICAL], "on a recording", WALKS)
            self.recording(given, desktop)

    def live(self, given: SimpleNamespace, desktop: bool) -> None:
        """Show an insect that walks until the window is closed or Ctrl-C is pressed."""
        from hexmj.cli.options import conditions
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
            twist = command.Command(given.velocity, given.left, given.turn)
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
