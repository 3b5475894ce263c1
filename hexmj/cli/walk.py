"""`hexmj walk`."""

import math
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import ControllerName, Figures, Workers
from hexmj.cli.recorded import recorded, walk_summary
from hexmj.cli.tables import four_digits, print_json, save_figure, show
from hexmj.cli.walking_command import WalkingCommand
from hexmj.io import MANIFEST, results_folder, save_manifest

SHOWN = ("vp", "step_height", "standing_height", "lift_time", "landing_time")
"""Conditions that the puppet of a plan shows too."""

TIMES = ("planned loss", "measured loss", "fall")
"""What a walk tells the time of, if it happens."""


@dataclass(frozen=True)
class Walk(WalkingCommand):
    """Options of `hexmj walk`, which `commands.COMMANDS` describes."""

    model: ControllerName = "ldvs"
    velocity: float = 0.3
    """Velocity V_r as a fraction of V_p, 0 <= V < 1."""
    physical: bool = False
    """Walk the insect in MuJoCo; without it a puppet shows the plan, which obeys V_p and the path of the feet only."""
    start: int = 0
    """Which of the seed's random starts."""
    out: Path = Path("results/walk")
    """Folder for the results."""
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    drawn: OmitArgPrefixes[Figures] = field(default_factory=Figures)

    def run(self) -> None:
        """Walk, and write recording, figure and manifest."""
        from hexmj.measures.tables import settings
        from hexmj.replay.footfall import walk_figure
        from hexmj.replay.recording import save_recording

        if not self.physical:
            self.refuse_physical("without --physical", SHOWN)
        controller = self.controlled.controller(self.model)
        figure = self.drawn.named("walk.png")
        out = results_folder(self.out)
        title = f"{controller.name}, V = {self.velocity:g}"
        how: Any = {"physical": self.physical, "threads": self.workers.threads}
        walked = recorded(self, controller, self.velocity, self.start, title=title, **how)
        told = {"velocity": self.velocity, "start": self.start, "physical": self.physical}
        told |= settings({self.model: controller}, n_starts=1, **self.walked)
        told |= {"conditions": self.conditions.settings()}
        files = [save_recording(walked, out / "recording.nc"), save_figure(walk_figure, walked, out / figure)]
        files.append(save_manifest(sys.argv[1:], told, files, out / MANIFEST))
        summary = walk_summary(walked)
        if self.json:
            print_json(summary | {"settings": told, "searched": self.searched, "files": files})
        else:
            lines = [f"{key}: {_told(key, value)}" for key, value in summary.items() if value is not None]
            beyond = () if self.physical else self.conditions.values().keys() - {*SHOWN}  # what a puppet obeys
            show(title, *lines, self.conditions_line(varied=beyond), *map(str, files))


def _told(key: str, value: Any) -> str:
    """A number of a walk, or that there is none; a time in words."""
    if key in TIMES:
        return f"at {four_digits(value)} time units" if math.isfinite(value) else "none within the walk"
    return str(value) if not isinstance(value, float) else "-" if math.isnan(value) else four_digits(value)
