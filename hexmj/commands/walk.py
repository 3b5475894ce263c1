"""`hexmj walk`."""

from typing import TYPE_CHECKING

from hexmj.commands.printing import conditions_line, print_json, save_figure, short, show
from hexmj.commands.recorded import recorded, walk_summary
from hexmj.loss_frequency import settings
from hexmj.presets import load_model, model_title
from hexmj.results import results_folder, save_manifest

if TYPE_CHECKING:
    from hexmj.cli import Walk


def run_walk(options: "Walk") -> None:
    """`hexmj walk`: one walk with its footfall diagram and stability margin."""
    from hexmj import figures, recording

    model, conditions = load_model(options.model), options.conditions
    out = results_folder(options.out, ("recording.nc", "walk.png", "manifest.json"))
    title = f"{model_title(options.model)}, V = {options.velocity:g}"
    walked = recorded(model, options.velocity, options.start, conditions, title, options.physical)
    told = {"velocity": options.velocity, "start": options.start, "physical": options.physical}
    acceleration, body = conditions.options["acceleration"], conditions.body
    told |= settings({options.model: model}, conditions.time, options.start + 1, conditions.seed, conditions.network,
                     acceleration, body)  # fmt: skip
    files = [
        recording.save_recording(walked, out / "recording.nc"),
        save_figure(figures.walk_figure(walked), out / "walk.png"),
        save_manifest(told, out / "manifest.json"),
    ]
    summary = walk_summary(walked)
    if options.json:
        print_json(summary | {"settings": told, "files": files})
    else:
        lines = [f"{key}: {short(value)}" for key, value in summary.items()]
        show(title, *lines, conditions_line(conditions, options.physical), *map(str, files))
