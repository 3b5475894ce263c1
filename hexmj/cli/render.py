"""`hexmj render`."""

import re
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tyro.conf import OmitArgPrefixes, Positional

from hexmj.body import STICK_INSECT
from hexmj.cli.options import ControllerName, Workers
from hexmj.cli.recorded import walk_summary, walked_start
from hexmj.cli.registry import changed
from hexmj.cli.tables import print_json, show
from hexmj.cli.walking_command import WalkingCommand
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, RenderingError
from hexmj.io import MANIFEST, results_folder, save_manifest
from hexmj.replay.film.film import MOST_PANELS, Film

if TYPE_CHECKING:
    import xarray as xr

LONGEST_NAME = 120
"""Characters of a file's name that titles make."""


@dataclass(frozen=True)
class Render(WalkingCommand):
    """Options of `hexmj render`, which `commands.COMMANDS` describes."""

    recordings: Positional[tuple[Path, ...]] = ()
    """One recording, or up to six side by side (recording.nc of `hexmj walk`); none: record a physical walk first, to
    which all options but the film's belong."""
    model: ControllerName = "ldvs"
    velocity: float = 0.3
    """Velocity V_r as a fraction of V_p, 0 <= V < 1."""
    beside: str | None = None
    """Side by side on the same start: 'planned' (the plan, with its polygon) or a second controller."""
    start: int = 0
    """Which of the seed's random starts."""
    format: Literal["mp4", "gif"] = "mp4"
    """Format of the video."""
    out: Path = Path("results/render")
    """Folder for the video and its recordings, whose names tell what they show."""
    film: OmitArgPrefixes[Film] = field(default_factory=Film)
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)

    def run(self) -> None:
        """Record if there is nothing to render yet, then render from the recordings."""
        from hexmj.replay.film.video import missing, render
        from hexmj.replay.recording import load_recording, save_recording
        from hexmj.replay.take import takes_of

        self._check()
        beside = [] if self.beside in (None, "planned") else [self.beside]
        controllers = self.controlled.controllers([self.model, *beside])
        shown = [load_recording(path) for path in self.recordings]
        takes_of(shown)  # refuses what cannot be filmed before a folder is made
        name = self._name(shown)
        video, walks = f"{name}.{self.format}", () if shown else (f"{name}-1.nc", f"{name}-2.nc")
        out = results_folder(self.out)
        manifest = f"{video}-{MANIFEST}"
        if sentence := missing():
            raise RenderingError(sentence)
        there = [one for one in (video, *walks) if (out / one).exists()]
        settings = {"film": asdict(self.film)}
        if not shown:
            shown = self._recorded(controllers)
            settings |= self._walked(controllers)
        for one in there:
            print(f"hexmj: {out / one!s} was there; the new one takes its place", file=sys.stderr)
        out.mkdir(parents=True, exist_ok=True)
        files = [save_recording(one, out / to) for one, to in zip(shown, walks, strict=False)]  # none that was given
        frames = render(shown, out / video, self.film, progress=True)
        files.append(out / video)
        files.append(save_manifest(sys.argv[1:], settings, files, out / manifest))
        if self.json:
            summary = {"frames": frames, "film": asdict(self.film), "files": files}
            print_json(summary | {"recordings": [walk_summary(one) for one in shown]})
        else:
            show(f"{frames} frame{'' if frames == 1 else 's'} at {self.film.fps:g} per second", *map(str, files))

    def _check(self) -> None:
        """Refuse options that would not be obeyed."""
        self.film.check_camera(STICK_INSECT)
        if len(self.recordings) > MOST_PANELS:
            raise InputError(f"{len(self.recordings)} recordings were given; expected 1 to {MOST_PANELS}")
        self.film.check_format(self.format)
        kept = {name: getattr(self, name) for name in ("recordings", "format", "out", "json", "film")}
        obeyed = Render(**kept)
        if self.recordings and (names := list(changed(self, obeyed))):
            raise InputError(
                f"--{names[0].replace('_', '-')} was given with recordings; expected more recordings for side by"
                " side, and options of walks only where one is recorded first"
            )
        if self.beside == self.model:
            raise InputError(f"--beside = {self.beside} is the --model, too; expected another controller, or 'planned'")

    def _name(self, shown: "Sequence[xr.Dataset]") -> str:
        """What the film shows, as its file is called."""
        told = [one.attrs["title"] for one in shown] or [f"{self.model} V {self.velocity:g}", self.beside or ""]
        camera = "" if self.film.camera == Film.camera else f" {self.film.camera}"
        words = " beside ".join(filter(None, told))[:LONGEST_NAME] + camera
        return re.sub(r"[^A-Za-z0-9.+-]+", "-", words).strip(".-") or "film"

    def _walked(self, controllers: dict[str, Controller]) -> dict[str, Any]:
        """Settings of the walks that are recorded first."""
        from hexmj.measures.tables import settings

        walks = settings(controllers, n_starts=1, **self.walked)
        told = {"velocity": self.velocity, "start": self.start, "beside": self.beside}
        return told | walks | {"conditions": self.conditions.settings()}

    def _recorded(self, controllers: dict[str, Controller]) -> "list[xr.Dataset]":
        """The walks that are to be seen."""
        from hexmj.replay.recording import record, record_plan

        walks = {
            name: walked_start(self, one, self.velocity, self.start, self.workers.threads)
            for name, one in controllers.items()
        }
        shown = [record(one, title=name) for name, one in walks.items()]
        if self.beside == "planned":
            ((name, walk),) = walks.items()
            shown.insert(0, record_plan(walk.planned, self.conditions, self.walks.stride, title=f"{name}, planned"))
        return shown
