"""What all commands do that conduct a study: walk with a progress bar, keep what is finished, write the results."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexmj.cli.options import Sweepers
from hexmj.cli.tables import save_figure
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_dataset, save_manifest
from hexmj.sweeps import Study, conduct

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def run_study(
    study: Study,
    label: str,
    out: Path,
    sweepers: Sweepers,
    *,
    data: str,
    figures: "Mapping[str, Callable[[xr.Dataset], Figure]]",
    manifest: str = "manifest.json",
    also: Sequence[str] = (),
) -> "tuple[xr.Dataset, list[Path]]":
    """The result of a study, and the files that it was written to.

    Args:
        study: to be conducted; what is finished in the folder `walks` is not walked again.
        label: of the progress bar.
        out: folder for the results.
        sweepers: what works.
        data: name of the NetCDF file.
        figures: by the names of their files.
        manifest: name of its file.
        also: names of files that the command writes itself.

    Raises:
        InputError: the folder cannot take the files; and whatever a cell raises.
    """
    folder = results_folder(out, [data, *figures, manifest, *also])
    with progress_bar(label) as progress, sweepers.executor() as executor:
        result = conduct(study, folder / "walks", executor=executor, progress=progress, threads=sweepers.threads_each)
    drawn = [save_figure(draw(result), folder / name) for name, draw in figures.items()]
    return result, [save_dataset(result, folder / data), *drawn, save_manifest(result.attrs, folder / manifest)]


def lists_of(result: "xr.Dataset") -> dict[str, Any]:
    """All coordinates and variables of a result as lists, for JSON."""
    return {str(name): result[name].values.tolist() for name in result.variables}
