"""The figure that belongs to a result, fresh or read from its file."""

from collections.abc import Callable
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from hexmj.checks import typed
from hexmj.errors import InputError
from hexmj.measures.drawable_parts import check_axes, check_observation_time, what_parts_may_lack

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.pictures import Picture

RECORDING = "recording"

FIGURES: dict[str, dict[str, str]] = {
    "flss": {"flss": "measures.figures:flss_figure"},
    "compare": {"comparison": "measures.figures:comparison_figure"},
    "map": {
        "map": "studies.stability_map.figure:map_figure",
        "mechanisms": "studies.stability_map.figure:mechanisms_figure",
    },
    "converge": {"converge": "studies.static_limit.figure:static_limit_figure"},
    "terrain": {"terrain": "studies.terrain.figure:terrain_figure"},
    "disturb": {"disturb": "studies.disturbance.figure:disturbed_figure"},
    "variants": {"variants": "studies.variants.figure:variants_figure"},
    "biology": {"biology": "studies.biology.figure:biology_figure"},
    "league": {"league": "studies.league.figure:league_figure", "walks": "studies.league.figure:walks_figure"},
    "ablate": {"ablation": "studies.ablation.figure:ablation_figure"},
    "model_variants": {"model_variants": "paper.readings_figure:readings_figure"},
    "search": {"convergence": "search.convergence:convergence_figure"},
    RECORDING: {"walk": "replay.footfall:walk_figure"},
}
"""What a result is of, as its attribute `study` tells -> its figures by name, each a module and a function of it."""


def plot(result: "xr.Dataset", which: str | None = None) -> "Picture":
    """Draw a result; a notebook shows the figure, and `savefig` of it writes PNG, PDF or SVG.

    Args:
        result: of `compare`, `flss`, `physical_flss`, `record` or a study, fresh or as `load` reads it.
        which: of several figures; the first one unless given.

    Raises:
        InputError: a dataset that no figure belongs to, no such figure, a part of a result that shows too little, or
            results joined whose controllers or observation times are not those that their settings tell.
    """
    import xarray as xr

    if not isinstance(result, xr.Dataset):
        raise InputError(
            f"result is of the type {type(result).__name__}; expected a Dataset: a result, what hexmj.load reads, or"
            " what hexmj.record makes of a walk"
        )
    study = RECORDING if "planned_stance" in result else str(result.attrs.get("study", ""))
    figures = FIGURES.get(study)
    if figures is None:
        raise InputError(
            f"a dataset of {', '.join(map(str, result.data_vars)) or 'nothing':.80}; expected a result, or what"
            f" hexmj.load reads, of {', '.join(FIGURES)}"
        )
    chosen = next(iter(figures)) if typed("which", which, str | None) is None else which
    if chosen not in figures:
        raise InputError(f"which = {which!r:.80}; valid names: {', '.join(figures)}")
    draw: Callable[[xr.Dataset], Picture] = resolve_name(f"hexmj.{figures[chosen]}")
    with what_parts_may_lack(result, f"the figure {chosen!r} cannot be drawn"):
        if study != RECORDING:
            check_axes(result)
            check_observation_time(result)
        return draw(result.compute())  # as it may have been opened lazily
