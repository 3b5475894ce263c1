"""hexmj: controllers of six-legged walking drive a stick insect in MuJoCo, and its stability is measured twice.

Units are mm, g, s and radians; velocities V are fractions of the protraction velocity V_p, and one time
unit of a plan is 1 mm / V_p.  Names are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hexmj import controllers as controllers
    from hexmj import environments as environments
    from hexmj import gaits as gaits
    from hexmj import sweep as sweep
    from hexmj.body import STICK_INSECT as STICK_INSECT
    from hexmj.body import Body as Body
    from hexmj.conditions import Conditions as Conditions
    from hexmj.controllers.cruse1998 import HWS as HWS
    from hexmj.controllers.cruse1998 import LDVS as LDVS
    from hexmj.controllers.cruse1998 import PRESETS as PRESETS
    from hexmj.controllers.cruse1998 import UNCOORDINATED as UNCOORDINATED
    from hexmj.controllers.cruse1998 import Cruse1998 as Cruse1998
    from hexmj.controllers.cruse1998 import Symmetric as Symmetric
    from hexmj.controllers.cruse1998 import Weights as Weights
    from hexmj.controllers.feedback import SensoryFeedback as SensoryFeedback
    from hexmj.controllers.registry import load_controller as load_controller
    from hexmj.errors import InputError as InputError
    from hexmj.errors import SimulationError as SimulationError
    from hexmj.io import load as load
    from hexmj.io import save as save
    from hexmj.io import settings as settings
    from hexmj.legs import CENTRED as CENTRED
    from hexmj.legs import FIG1 as FIG1
    from hexmj.legs import Geometry as Geometry
    from hexmj.measures.compare import compare as compare
    from hexmj.measures.compare import physical_flss as physical_flss
    from hexmj.measures.kinematic import first_loss as first_loss
    from hexmj.measures.kinematic import flss as flss
    from hexmj.measures.kinematic import flss_over_range as flss_over_range
    from hexmj.measures.kinematic import walk as walk
    from hexmj.measures.physical import PhysicalWalk as PhysicalWalk
    from hexmj.measures.physical import physical_walk as physical_walk
    from hexmj.plotting import plot as plot
    from hexmj.replay.film import Film as Film
    from hexmj.replay.page import page as page
    from hexmj.replay.recording import load_recording as load_recording
    from hexmj.replay.recording import record as record
    from hexmj.replay.recording import record_plan as record_plan
    from hexmj.replay.recording import save_recording as save_recording
    from hexmj.replay.video import render as render
    from hexmj.search.forms import FieldsForm as FieldsForm
    from hexmj.search.forms import NetworkForm as NetworkForm
    from hexmj.search.problems import Problem as Problem
    from hexmj.search.stages import Effort as Effort
    from hexmj.stability import loss_time as loss_time
    from hexmj.stability import stability_margin as stability_margin
    from hexmj.stability import support_polygon as support_polygon
    from hexmj.stability import walk_margin as walk_margin
    from hexmj.starts import draw_starts as draw_starts
    from hexmj.timing import Acceleration as Acceleration
    from hexmj.timing import Stride as Stride
    from hexmj.version import __version__ as __version__
    from hexmj.walks import Walk as Walk

_MODULES = {
    "body": ("STICK_INSECT", "Body"),
    "conditions": ("Conditions",),
    "controllers.cruse1998": ("HWS", "LDVS", "PRESETS", "UNCOORDINATED", "Cruse1998", "Symmetric", "Weights"),
    "controllers.registry": ("load_controller",),
    "controllers.feedback": ("SensoryFeedback",),
    "errors": ("InputError", "SimulationError"),
    "io": ("load", "save", "settings"),
    "legs": ("CENTRED", "FIG1", "Geometry"),
    "measures.compare": ("compare", "physical_flss"),
    "measures.kinematic": ("first_loss", "flss", "flss_over_range", "walk"),
    "measures.physical": ("PhysicalWalk", "physical_walk"),
    "plotting": ("plot",),
    "replay.film": ("Film",),
    "replay.video": ("render",),
    "replay.page": ("page",),
    "replay.recording": ("load_recording", "record", "record_plan", "save_recording"),
    "search.forms": ("FieldsForm", "NetworkForm"),
    "search.problems": ("Problem",),
    "search.stages": ("Effort",),
    "stability": ("loss_time", "stability_margin", "support_polygon", "walk_margin"),
    "starts": ("draw_starts",),
    "timing": ("Acceleration", "Stride"),
    "version": ("__version__",),
    "walks": ("Walk",),
}
_PARTS = ("controllers", "environments", "gaits", "sweep")
_HOME = {name: module for module, names in _MODULES.items() for name in names}
__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _PARTS:
        return import_module(f"hexmj.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'hexmj' has no attribute {name!r}; it has {', '.join(__dir__())}")
    value = getattr(import_module(f"hexmj.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, *_PARTS]
