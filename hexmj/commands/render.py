"""`hexmj render`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from hexmj.commands.printing import print_json, show
from hexmj.commands.recorded import recorded, walk_summary
from hexmj.errors import InputError, RenderingError
from hexmj.presets import load_model
from hexmj.progress import progress_bar
from hexmj.results import results_folder

if TYPE_CHECKING:
    from hexmj.cli import Render


def run_render(options: "Render") -> None:
    """`hexmj render`: record if there is nothing to render yet, then render from the recordings."""
    from hexmj import recording
    from hexmj.film import gl
    from hexmj.film.video import render

    if len(options.recordings) > 2:
        raise InputError(f"{len(options.recordings)} recordings were given; expected one, or two for side by side")
    if options.recordings and options.beside:
        raise InputError("--beside was given with recordings; expected a second recording instead, or no recording")
    names = [name for name in (options.model, options.beside) if name and name != "planned"]
    models = [load_model(name) for name in names]
    shown = [recording.load_recording(path) for path in options.recordings]
    out = results_folder(options.out, ("gait.mp4", "recording-1.nc", "recording-2.nc"))
    if sentence := gl.missing():
        raise RenderingError(sentence)
    files = []
    if not shown:
        titles = [Path(name).stem for name in names]
        how = [(model, title, True) for model, title in zip(models, titles, strict=True)]
        if options.beside == "planned":
            how.insert(0, (models[0], f"{titles[0]}, planned", False))
        for i, (model, title, physical) in enumerate(how):
            one = recorded(model, options.velocity, options.start, options.conditions, title, physical)
            files.append(recording.save_recording(one, out / f"recording-{i + 1}.nc"))
            shown.append(one)
    out.mkdir(parents=True, exist_ok=True)
    with progress_bar("rendering") as progress:
        frames = render(shown, out / "gait.mp4", options.film, progress)
    files.append(out / "gait.mp4")
    summary = {"frames": frames, "film": asdict(options.film), "files": files}
    if options.json:
        print_json(summary | {"recordings": [walk_summary(one) for one in shown]})
    else:
        show(f"{frames} frames at {options.film.fps:g} per second", *map(str, files))
    for one in shown:
        one.close()
