"""What the figures of the studies share: curves of frequencies, and axes without a frame."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr
    from matplotlib.axes import Axes


def frequency_curve(axes: "Axes", x: "np.ndarray | xr.DataArray", one: "xr.Dataset", name: str, **style: Any) -> None:
    """One of a result's frequencies with its intervals, in the style of `Axes.errorbar`."""
    low, middle, high = (one[name + end].values for end in ("_low", "", "_high"))
    dots: dict[str, Any] = {"marker": "o", "markersize": 4, "linewidth": 1.6, "capsize": 2.5}
    axes.errorbar(x, middle, [middle - low, high - middle], **dots | style)


def tidy(axes: "Axes") -> None:
    """A grid, and no frame above and on the right."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.8)
