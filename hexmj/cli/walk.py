"""`hexmj walk`."""

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import Accelerating, Controlled, ControllerName, Walks, Workers, refuse_physical
from hexmj.cli.recorded import recorded, walk_summary
from hexmj.cli.tables import conditions_line, print_json, save_figure, short, show
from hexmj.conditions import Conditions, FootPath, TimeScale
from hexmj.results import results_folder, save_manifest

SHOWN = tuple(one.name for part in (TimeScale, FootPath) for one in fields(part))
"""Conditions that the puppet of a plan shows too."""


@dataclass(frozen=True)
class Walk:
    """One walk, kinematic or physical: footfall diagram, stability margin and a recording (NetCDF)."""

    model: ControllerName = "ldvs"
    velocity: float = 0.3
    """Velocity V_r as a fraction of V_p, 0 <= V < 1."""
    physical: bool = False
    """Walk the insect in MuJoCo; without it a puppet shows the plan, which obeys V_p and the path of the feet only."""
    start: int = 0
    """Which of the seed's random starts."""
    out: Path = Path("results/walk")
    """Folder for the results."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    walks: OmitArgPrefixes[Walks] = field(default_factory=Walks)
    accelerating: OmitArgPrefixes[Accelerating] = field(default_factory=Accelerating)
    controlled: OmitArgPrefixes[Controlled] = field(default_factory=Controlled)
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)

    def run(self) -> None:
        """Walk, and write recording, figure and manifest."""
        from hexmj.measures.kinematic import settings
        from hexmj.replay.footfall import walk_figure
        from hexmj.replay.recording import save_recording

        if not self.physical:
            refuse_physical(self.conditions, self.controlled, "without --physical", SHOWN)
        controller, acceleration = self.controlled.controller(self.model), self.accelerating.procedure
        out = results_folder(self.out, ("recording.nc", "walk.png", "manifest.json"))
        title = f"{controller.name}, V = {self.velocity:g}"
        walked = recorded(
            controller, self.velocity, self.start, self.walks, acceleration, self.conditions,
            physical=self.physical, title=title, threads=self.workers.threads,
        )  # fmt: skip
        manifest = {"velocity": self.velocity, "start": self.start, "physical": self.physical}
        manifest |= settings({self.model: controller}, self.walks.time, self.start + 1, self.walks.seed,
                             self.walks.stride, acceleration)  # fmt: skip
        manifest |= {"conditions": asdict(self.conditions)}
        files = [
            save_recording(walked, out / "recording.nc"),
            save_figure(walk_figure(walked), out / "walk.png"),
            save_manifest(manifest, out / "manifest.json"),
        ]
        summary = walk_summary(walked)
        if self.json:
            print_json(summary | {"settings": manifest, "files": files})
        else:
            lines = [f"{key}: {short(value)}" for key, value in summary.items()]
            line = conditions_line(
                self.walks, self.controlled, acceleration, self.conditions if self.physical else None
            )
            show(title, *lines, line, *map(str, files))
