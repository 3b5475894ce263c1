"""hexmj: the 1998 coordination network drives a stick insect in MuJoCo, and its stability is measured twice.

Units are mm, g, s and radians; velocities V are fractions of the protraction velocity V_p, and one time
unit of the network is 1 mm / V_p.  Names are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hexmj.film.gl import prefer_egl

if TYPE_CHECKING:
    from hexmj.comparison import compare as compare
    from hexmj.comparison import physical_flss as physical_flss
    from hexmj.errors import InputError as InputError
    from hexmj.errors import SimulationError as SimulationError
    from hexmj.film.video import Film as Film
    from hexmj.film.video import render as render
    from hexmj.legs import CENTRED as CENTRED
    from hexmj.legs import FIG1 as FIG1
    from hexmj.legs import Geometry as Geometry
    from hexmj.loss_frequency import draw_starts as draw_starts
    from hexmj.loss_frequency import flss as flss
    from hexmj.loss_frequency import flss_over_range as flss_over_range
    from hexmj.network import first_loss as first_loss
    from hexmj.network import walk as walk
    from hexmj.parameters import HWS as HWS
    from hexmj.parameters import LDVS as LDVS
    from hexmj.parameters import UNCOORDINATED as UNCOORDINATED
    from hexmj.parameters import Acceleration as Acceleration
    from hexmj.parameters import Network as Network
    from hexmj.parameters import Symmetric as Symmetric
    from hexmj.parameters import Weights as Weights
    from hexmj.physics.body import Body as Body
    from hexmj.physics.physical_walks import PhysicalWalk as PhysicalWalk
    from hexmj.physics.physical_walks import physical_walk as physical_walk
    from hexmj.presets import PRESETS as PRESETS
    from hexmj.presets import load_model as load_model
    from hexmj.recording import load_recording as load_recording
    from hexmj.recording import record as record
    from hexmj.recording import record_plan as record_plan
    from hexmj.recording import save_recording as save_recording
    from hexmj.search.problems import Problem as Problem
    from hexmj.search.stages import Plan as Plan
    from hexmj.stability import loss_time as loss_time
    from hexmj.stability import stability_margin as stability_margin
    from hexmj.stability import support_polygon as support_polygon
    from hexmj.stability import walk_margin as walk_margin
    from hexmj.walks import Walk as Walk

_MODULES = {
    "presets": ("PRESETS", "load_model"),
    "physics.body": ("Body",),
    "comparison": ("compare", "physical_flss"),
    "errors": ("InputError", "SimulationError"),
    "legs": ("CENTRED", "FIG1", "Geometry"),
    "loss_frequency": ("draw_starts", "flss", "flss_over_range"),
    "network": ("first_loss", "walk"),
    "parameters": (
        "HWS",
        "LDVS",
        "UNCOORDINATED",
        "Acceleration",
        "Network",
        "Symmetric",
        "Weights",
    ),
    "physics.physical_walks": ("PhysicalWalk", "physical_walk"),
    "search.problems": ("Problem",),
    "recording": ("load_recording", "record", "record_plan", "save_recording"),
    "search.stages": ("Plan",),
    "stability": ("loss_time", "stability_margin", "support_polygon", "walk_margin"),
    "film.video": ("Film", "render"),
    "walks": ("Walk",),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}
__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]

prefer_egl()


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'hexmj' has no attribute {name!r}; it has {', '.join(__all__)}")
    value = getattr(import_module(f"hexmj.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
