"""The command line: typed options in, one call to the package, tables and files out."""

import sys
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, subcommand
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from hexmj.errors import InputError, RenderingError, SimulationError
from hexmj.film.film import Film
from hexmj.legs import GEOMETRIES, Geometry
from hexmj.parameters import Acceleration, Network
from hexmj.physics.body import Body

_ABOUT = "A stick insect in MuJoCo, driven by the coordination network of 1998, and its stability measured twice."


@dataclass(frozen=True)
class Conditions:
    """What a walk needs besides its model and velocity."""

    window: str = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (40 time units) or a number [time units]."""
    seed: int = 0
    """Seed of the random starts."""
    acceleration: float | None = None
    """Accelerate from --initial-velocity with this a of Eq. 11 [1 / time unit]; the paper's is 0.00008."""
    initial_velocity: float = 0.1
    """V_r(0) when accelerating, a fraction of V_p."""
    threads: int | None = None
    """Threads; one per core unless given.  No result depends on it."""
    network: OmitArgPrefixes[Network] = field(default_factory=Network)
    body: OmitArgPrefixes[Body] = field(default_factory=Body)

    @property
    def options(self) -> dict[str, Any]:
        """Arguments that every function of the package understands."""
        a = Acceleration(self.acceleration, self.initial_velocity) if self.acceleration is not None else None
        return {"network": self.network, "acceleration": a, "threads": self.threads}

    @property
    def time(self) -> str | float:
        """The window's name, or its number of time units."""
        try:
            return float(self.window)
        except ValueError:
            return self.window


@dataclass(frozen=True)
class Compare:
    """Kinematic, measured and physical FLSS on the same starts: table, figure, NetCDF, manifest and one gait video."""

    models: tuple[str, ...] = ("ldvs", "uncoordinated")
    """Presets (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or parameter files (TOML)."""
    velocities: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 <= V < 1."""
    starts: int = 60
    """Number of random starts, the same for every model and velocity."""
    out: Path = Path("results/compare")
    """Folder for the results."""
    no_video: bool = False
    """Leave the video out."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)


@dataclass(frozen=True)
class Flss:
    """FLSS of one model over velocities, kinematic or physical."""

    model: str = "ldvs"
    """A preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or a parameter file (TOML)."""
    velocities: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Velocities V_r as fractions of V_p, 0 <= V < 1; when accelerating, the final ones."""
    physical: bool = False
    """Count falls of the insect in MuJoCo instead of losses of the planned polygon."""
    starts: int | None = None
    """Number of random starts; 7000 unless given (seven samples of 1000, as in the paper), 200 if physical."""
    out: Path | None = None
    """Folder for figure, NetCDF and manifest; none are written unless given."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)


@dataclass(frozen=True)
class Walk:
    """One walk, kinematic or physical: footfall diagram, stability margin and a recording (NetCDF)."""

    model: str = "ldvs"
    """A preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or a parameter file (TOML)."""
    velocity: float = 0.3
    """Velocity V_r as a fraction of V_p, 0 <= V < 1."""
    physical: bool = False
    """Walk the insect in MuJoCo instead of the plan alone."""
    start: int = 0
    """Which of the seed's random starts."""
    out: Path = Path("results/walk")
    """Folder for the results."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)


@dataclass(frozen=True)
class Render:
    """A gait video, from recordings or from a walk that is recorded first."""

    recordings: Positional[tuple[Path, ...]] = ()
    """One recording, or two for side by side (recording.nc of `hexmj walk`); none: record a physical walk first."""
    model: str = "ldvs"
    """A preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or a parameter file (TOML)."""
    velocity: float = 0.3
    """Velocity V_r as a fraction of V_p, 0 <= V < 1."""
    beside: str | None = None
    """Side by side on the same start: 'planned' (the plan, with its polygon) or a second model."""
    start: int = 0
    """Which of the seed's random starts."""
    out: Path = Path("results/render")
    """Folder for the video and its recordings."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    film: OmitArgPrefixes[Film] = field(default_factory=Film)
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)


@dataclass(frozen=True)
class Search:
    """Parameters that minimise the FLSS: a population with few starts, then the downhill simplex with many.

    Repeat the command to go on with a search that was stopped.
    """

    form: Literal["hws", "ldvs", "mirrored", "general"] = "ldvs"
    """Nine parameters (hws), ten with a neutral position that depends on the velocity (ldvs), or 29, in which only
    left and right are alike (mirrored), or all 58 weights (general)."""
    velocity: float | None = None
    """Problem 1: this velocity V_r as a fraction of V_p, 0 <= V < 1; 0.3 unless one or a range is given."""
    velocities: tuple[float, float] | None = None
    """Problem 2: velocities drawn uniformly from this range."""
    physical: bool = False
    """Minimise falls of the insect in MuJoCo instead of losses of the planned polygon."""
    algorithm: Literal["evolution", "cmaes"] = "evolution"
    """The paper's evolutionary algorithm, or CMA-ES."""
    population: int = 10
    """Individuals of a generation; the paper's L."""
    domain: float = 10.0
    """The first population's shifts [mm] and weights are drawn from 0 to this, neutral positions [mm] from minus this
    to this; not printed in the paper."""
    begin: str | None = None
    """A preset or a parameter file (TOML) from which the population begins; without it the paper's '0'-individual
    (evolution) or the middle of the domain (cmaes)."""
    starts: int | None = None
    """Random starts of each candidate, the same for all; 500 unless given, 50 if physical."""
    budget: int = 1000
    """Most evaluations of the population's search; at L = 10 about the paper's 100 iterations."""
    refine_starts: int | None = None
    """Random starts of each candidate of the simplex; 7000 unless given, 100 if physical."""
    refine_budget: int = 400
    """Most evaluations of the simplex; 0 leaves it out."""
    verdict_starts: int | None = None
    """Fresh random starts for the verdict; 7000 unless given, 200 if physical."""
    verdict_seed: int = 1998
    """Seed of the fresh starts; another than --seed."""
    out: Path = Path("results/search")
    """Folder for the model (TOML), the history (NetCDF), a figure and a manifest."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)


@dataclass(frozen=True)
class Reproduce:
    """The paper's Section 5: every claim with our number and verdict, Figures 2-6, phase histograms, footfall diagrams.

    Repeat the command to go on with a run that was stopped.
    """

    quick: bool = False
    """Fewer starts and velocities, under a minute; the full protocol takes several."""
    only: tuple[str, ...] = ()
    """Keys of the claims to judge, without figures; all unless given."""
    seed: int = 1998
    """Seed of the random starts; the ideal sets were searched with 0 and 1."""
    out: Path = Path("results/reproduce")
    """Folder for the table (Markdown, JSON), the figures and what was measured."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""


@dataclass(frozen=True)
class Converge:
    """The same starts at smaller and smaller V_p: does the insect tend to its plan and to the static criterion?

    Repeat the command to go on with a run that was stopped.
    """

    model: str = "ldvs"
    """A preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or a parameter file (TOML)."""
    velocity: float = 0.5
    """Velocity V_r as a fraction of V_p, 0 <= V < 1."""
    vps: tuple[float, ...] = (400.0, 200.0, 100.0, 50.0, 25.0)
    """Velocities V_p of a protracting tip [mm/s], instead of --vp."""
    leg_masses: tuple[float, ...] = (1.0, 0.01)
    """Masses of the legs as fractions of the insect's own, instead of --leg-mass; the paper's legs have none."""
    starts: int = 200
    """Number of random starts, the same for every V_p and mass."""
    out: Path = Path("results/converge")
    """Folder for figure, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=lambda: Conditions(body=Body(longest_substep=0.5)))


@dataclass(frozen=True)
class Terrain:
    """Steps, gaps, hurdles and rough ground in physics: how often the insect falls once it has reached one.

    Repeat the command to go on with a run that was stopped.
    """

    model: str = "ldvs"
    """A preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or a parameter file (TOML)."""
    velocities: tuple[float, ...] = (0.2, 0.4, 0.6)
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    grounds: tuple[Literal["step", "gap", "hurdle", "rough"], ...] = ("step", "gap", "hurdle", "rough")
    """Kinds of obstacles, beside flat ground."""
    heights: tuple[float, ...] = (2.0, 4.0, 6.0)
    """Heights of steps, hurdles and rough ground [mm], instead of --ground-height."""
    lengths: tuple[float, ...] = (2.5, 5.0, 10.0)
    """Lengths of gaps [mm]; --ground-length is the hurdle's."""
    grasps: tuple[float, ...] = (0.0, 1.0)
    """Adhesion of a foot that the plan lets stand, in multiples of the insect's weight, instead of --grasp."""
    starts: int = 30
    """Number of random starts, the same for every obstacle."""
    out: Path = Path("results/terrain")
    """Folder for figure, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=lambda: Conditions(body=Body(ground_at=80.0)))


@dataclass(frozen=True)
class Map:
    """Physical FLSS over the velocity and one condition of the body, and why starts fall or do not.

    Repeat the command to go on with a run that was stopped.
    """

    over: Literal["vp", "step_height", "standing_height", "friction", "load", "centre_of_mass"] = "vp"
    """The condition that is varied."""
    values: tuple[float, ...] = ()
    """Its values, in its own unit; five usual ones unless given."""
    velocities: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 <= V < 1."""
    model: str = "ldvs"
    """A preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or a parameter file (TOML)."""
    starts: int = 100
    """Number of random starts, the same for every value and velocity."""
    out: Path = Path("results/map")
    """Folder for figures, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)


@dataclass(frozen=True)
class Disturb:
    """Walks that a halt, a stopped leg or a push disturbs, on paper and in physics, and what three strategies buy.

    Repeat the command to go on with a run that was stopped.
    """

    model: str = "ldvs"
    """A preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9) or a parameter file (TOML)."""
    velocities: tuple[float, ...] = (0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    disturbances: tuple[Literal["halt", "leg", "push"], ...] = ()
    """The body is halted, or one protracting leg is stopped, or the body is pushed from the side; all unless given."""
    impulses: tuple[float, ...] = (40.0, 60.0)
    """Impulses of the pushes, in multiples of the insect's mass times V_p."""
    strategies: tuple[Literal["reorganise", "slow_down", "grasp"], ...] = ()
    """Legs go to the nearest posture of undisturbed walking, or the walk begins again from --initial-velocity, or feet
    hold on to the ground; all, beside none, unless given."""
    recovery: float = 0.002
    """Acceleration a of Eq. 11 after slowing down [1 / time unit]; the paper's is 0.00008."""
    adhesion: float = 1.0
    """Adhesion of a foot that the plan lets stand where the strategy is to grasp, in multiples of the insect's weight,
    instead of --grasp."""
    starts: int = 40
    """Number of random starts that walk stably until they are disturbed, the same in every case."""
    kinematic: bool = False
    """Leave physics out, and with it pushes and grasping."""
    out: Path = Path("results/disturb")
    """Folder for figure, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)


@dataclass(frozen=True)
class Doctor:
    """Checks of this machine, each with a remedy where it fails; exit code 1 if one does."""

    json: bool = False
    """Print one JSON object on standard output, nothing else."""


Command = (
    Annotated[Compare, subcommand("compare")]
    | Annotated[Flss, subcommand("flss")]
    | Annotated[Walk, subcommand("walk")]
    | Annotated[Render, subcommand("render")]
    | Annotated[Search, subcommand("search")]
    | Annotated[Reproduce, subcommand("reproduce")]
    | Annotated[Converge, subcommand("converge")]
    | Annotated[Terrain, subcommand("terrain")]
    | Annotated[Map, subcommand("map")]
    | Annotated[Disturb, subcommand("disturb")]
    | Annotated[Doctor, subcommand("doctor")]
)

_registry = ConstructorRegistry()


@_registry.primitive_rule
def _named_geometry(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Geometry] | None:
    """On the command line a geometry is given by its name."""
    if info.type is not Geometry:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="{" + ",".join(GEOMETRIES) + "}",
        instance_from_str=lambda words: GEOMETRIES[words[0]],
        is_instance=lambda value: isinstance(value, Geometry),
        str_from_instance=lambda value: [name for name, g in GEOMETRIES.items() if g == value],
        choices=tuple(GEOMETRIES),
    )


def main() -> None:
    """The command `hexmj`: exit code 2 for input that makes no sense, 1 for a simulation that failed."""
    try:
        options = tyro.cli(Command, prog="hexmj", description=_ABOUT, registry=_registry, config=(FlagCreatePairsOff,))
        name = type(options).__name__.lower()
        getattr(import_module(f"hexmj.commands.{name}"), f"run_{name}")(options)
    except KeyboardInterrupt:
        sys.exit(_complain("stopped", 130))
    except InputError as error:
        sys.exit(_complain(error, 2))
    except (SimulationError, RenderingError) as error:
        sys.exit(_complain(error, 1))


def _complain(error: Exception | str, code: int) -> int:
    print(f"hexmj: {error}", file=sys.stderr)
    return code
