"""`hexmj search`."""

import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tyro.conf import OmitArgPrefixes

from hexmj.cli.loaded import loaded, seeds_of_searches
from hexmj.cli.options import Controlled, Figures, Workers
from hexmj.cli.tables import interval, print_json, save_figure, show, table
from hexmj.cli.walking_command import WalkingCommand
from hexmj.errors import InputError
from hexmj.files import read_toml, write_text
from hexmj.io import MANIFEST, results_folder, save, save_manifest
from hexmj.progress import progress_bar
from hexmj.starts import SAMPLE, check_draw
from hexmj.threads import thread_count

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from hexmj.controllers.protocol import Controller
    from hexmj.search.forms import Form
    from hexmj.search.problems import Problem
    from hexmj.search.stages import Effort, Found

FOUND = "found.toml"
"""What was found."""

KEPT = "evaluations"
"""Folder of the evaluations, beside the results."""


@dataclass(frozen=True)
class Search(WalkingCommand):
    """Options of `hexmj search`, which `commands.COMMANDS` describes."""

    form: str = "ldvs"
    """Nine parameters (hws), ten with a neutral position that depends on the velocity (ldvs), or 29, in which only
    left and right are alike (mirrored), or all 58 weights (general) of the 1998 network; or a controller of your own
    (module:object, file.py:object, an entry point), whose float fields are searched."""
    velocity: float | None = None
    """Problem 1: this velocity V_r as a fraction of V_p, 0 <= V < 1; 0.3 unless one or a range is given."""
    velocities: tuple[float, float] | None = None
    """Problem 2: velocities drawn uniformly from this range."""
    physical: bool = False
    """Minimise falls of the insect in MuJoCo instead of losses of the planned polygon."""
    over: Literal["usual", "mean", "worst"] = "usual"
    """Minimise the FLSS as given (usual), or its mean or worst over variants of constants and rules that the paper does
    not print (`hexmj variants`; in physics without AEP0 11); what is so anyway is as usually instead."""
    ties: Literal["equal", "later"] = "equal"
    """Of candidates that lose equally many starts none is better (equal), or that which loses them later."""
    algorithm: Literal["evolution", "cmaes"] = "evolution"
    """The paper's evolutionary algorithm, or CMA-ES."""
    population: int = 10
    """Individuals of a generation; the paper's L."""
    domain: float = 10.0
    """The first population's shifts [mm] and weights are drawn from 0 to this, neutral positions [mm] from minus this
    to this; not printed in the paper.  Fields of a controller of your own: from 0 to this times the usual value,
    or to this where that is 0."""
    begin: str | None = None
    """A controller from which the population begins, with its order of updates and reading unless they are given;
    without it the paper's '0'-individual (evolution), the middle of the domain (cmaes), or the usual values of a
    controller of your own."""
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
    """Folder for what was found (TOML), the history (NetCDF), a figure, a manifest and all evaluations."""
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    drawn: OmitArgPrefixes[Figures] = field(default_factory=Figures)

    def run(self) -> None:
        """Search, judge what was found on fresh starts, write and print."""
        from hexmj.plain import plain
        from hexmj.search.samples import Sample
        from hexmj.search.stages import search

        if (controlled := self._as_begun) != self.controlled:
            replace(self, controlled=controlled).run()
            return
        self._check()
        problem, effort = self._problem(), self._effort()
        self._check_fresh()
        beside = {name: self.controlled.controller(controller) for name, controller in self._beside.items()}
        self.refuse_contact_gap(next(iter(beside.values())))
        problem.domain(effort.domain, effort.begin)  # what it refuses is refused before there is a folder
        size = self._size(self.verdict_starts, 7 * SAMPLE, 200)
        fresh = Sample(problem, *check_draw(size, self.verdict_seed, "verdict_starts", "verdict_seed"))
        out = results_folder(self.out)
        fresh.settle(self.workers.threads)  # what refuses to stand is told before the work
        found = search(problem, effort, folder=out / KEPT, threads=self.workers.threads, progress=True)
        settings = {
            "problem": problem.settings(),
            "effort": plain(effort),
            "verdict_starts": fresh.n_starts,
            "verdict_seed": self.verdict_seed,
        }
        files = self._write(problem, found, settings)  # whatever the verdict is
        judged = {"found": problem.controller(found.vector)} | beside
        try:
            with progress_bar("judging") as progress:
                verdict = fresh.verdict(judged, self.workers.threads, progress)
        except InputError as error:
            raise InputError(f"{error}; what was found is in {out / FOUND}") from None
        if self.json:
            evaluations = found.history.sizes["evaluation"]
            told = {"cost": found.cost, "evaluations": evaluations, "replayed": found.replayed}
            told |= {"minimised": problem.minimised, "lost": found.lost, "starts": found.starts}
            told |= {"refused": len(found.refused), "verdict": _judged(verdict), "settings": settings, "files": files}
            vector = dict(zip(problem.form.names, found.vector.tolist(), strict=True))
            print_json({"found": vector} | told)
        else:
            self._show(problem, found, verdict, fresh.n_starts, files)

    def _check(self) -> None:
        """Refuse what makes no sense together, or would not be obeyed."""
        from hexmj.controllers.varied_names import PART

        thread_count(self.workers.threads)
        if not self.physical:
            self.refuse_physical("without --physical")
        if self.verdict_seed == self.walks.seed:
            raise InputError(f"--verdict-seed = {self.verdict_seed} is also --seed; expected another, for fresh starts")
        begun = [Path(PART.sub("", one)).resolve() for one in (self.form, self.begin) if one]
        if (self.out / FOUND).resolve() in begun:
            raise InputError(f"--out {self.out}: the search begins with {FOUND} there; expected another folder")
        if self.velocity is not None and self.velocities is not None:
            raise InputError("--velocity and --velocities were both given; expected one velocity or one range")
        if self.refine_starts is not None and not self.refine_budget:
            raise InputError("--refine-starts was given with --refine-budget 0; expected evaluations that walk them")

    def _check_fresh(self) -> None:
        """Refuse a verdict on starts on which an earlier search found what this one begins with."""
        if self.verdict_seed in self._seeds:
            raise InputError(
                f"--verdict-seed = {self.verdict_seed} is that of the search that found what this one begins with;"
                " expected another, for fresh starts"
            )

    def _problem(self) -> "Problem":
        from hexmj.search.problems import Problem

        how = {name: value for name, value in self.walked.items() if name != "seed"}
        conditions = self.conditions if self.physical else None
        chosen = {"feedback": self.controlled.feedback, "over": self.over, "ties": self.ties}
        return Problem(self._form(), *self.commanded, **how, conditions=conditions, **chosen)

    @property
    def _as_begun(self) -> Controlled:
        """Planning with the order of updates and the reading of the set that the search begins with, unless given."""
        from hexmj.controllers.cruse1998 import Cruse1998
        from hexmj.controllers.cruse1998.model_variants import MODEL_VARIANTS, variant_name
        from hexmj.search.network_forms import FORMS

        begun = loaded(self.begin) if self.begin and self.form in FORMS else None
        if type(begun) is not Cruse1998:
            return self.controlled
        taken: dict[str, Any] = {} if self.controlled.order else {"order": begun.order}
        if not self.controlled.model_variant:
            try:
                taken["model_variant"] = variant_name(begun.model_variant)
            except InputError:
                told = f"--begin = {self.begin}: its reading has no name"
                raise InputError(f"{told}; expected --reading beside it, one of {', '.join(MODEL_VARIANTS)}") from None
        return replace(self.controlled, **{rule: name for rule, name in taken.items() if name != "printed"})

    def _form(self) -> "Form":
        from hexmj.controllers.named import parameter_file
        from hexmj.controllers.varied_names import PART
        from hexmj.search.forms import FieldsForm
        from hexmj.search.network_forms import FORMS, NetworkForm

        if self.form in FORMS:
            return NetworkForm(self.form, **self.controlled.rules)
        for name in self.controlled.rules:
            raise InputError(f"--{name} with {self.form}; expected it with {', '.join(FORMS)}")
        if (whole := PART.sub("", self.form)) != self.form and parameter_file(whole):
            raise InputError(f"--form = {self.form}; expected {whole}, or the controller that it names, without a part")
        try:
            return FieldsForm(loaded(self.form))
        except InputError as error:
            raise InputError(f"--form: {error}; forms of the 1998 network: {', '.join(FORMS)}") from None

    def _effort(self) -> "Effort":
        from hexmj.search.stages import Effort

        same = "algorithm", "population", "domain", "budget", "refine_budget"
        return Effort(
            **{name: getattr(self, name) for name in same},
            begin=self._begins_with,
            starts=self._size(self.starts, 500, 50),
            refine_starts=self._size(self.refine_starts, 7 * SAMPLE, 100),
            seed=self.walks.seed,
        )

    @property
    def _begins_with(self) -> "Controller | None":
        """What the search begins with, by the rules that were given."""
        from hexmj.controllers.cruse1998 import Cruse1998

        found = loaded(self.begin) if self.begin else None
        return replace(found, **self.controlled.rules) if type(found) is Cruse1998 else found

    def _size(self, given: int | None, planned: int, walked: int) -> int:
        """A number of starts: fewer of physical walks."""
        return given if given is not None else walked if self.physical else planned

    @property
    def _beside(self) -> dict[str, str]:
        """What the found set is compared with: the paper's two, or the usual values of a controller of the user's."""
        from hexmj.search.network_forms import FORMS

        return {"hws": "hws", "ldvs": "ldvs"} if self.form in FORMS else {"usual": self.form}

    @property
    def _kind(self) -> str:
        return "physical" if self.physical else "kinematic"

    @property
    def _seeds(self) -> list[int]:
        """Of the searches that found what this one begins with."""
        from hexmj.search.network_forms import FORMS

        begun = [one for one in (self.form, self.begin) if one and one not in FORMS]
        return [seed for one in begun for seeds in seeds_of_searches(one).values() for seed in seeds]

    @property
    def commanded(self) -> tuple[float, float]:
        v = 0.3 if self.velocity is None else self.velocity
        return self.velocities or (v, v)

    @property
    def _figure(self) -> str:
        return self.drawn.named("convergence.png")

    @property
    def _title(self) -> str:
        low, high = self.commanded
        at = f"V from {low:g} to {high:g}" if self.velocities else f"V = {low:g}"
        at += f", {self.over} of all variants" if self.over != "usual" else ""
        at += ", later losses first among equals" if self.ties == "later" else ""
        method = f"observation time {self.walks.observation_time}, {self.algorithm}, seed {self.walks.seed}"
        return f"{self.form}, {self._kind} FLSS at {at}, {method}"

    def _write(self, problem: "Problem", found: "Found", settings: dict[str, Any]) -> list[Path]:
        from hexmj.search.convergence import convergence_figure

        seeds = sorted({*self._seeds, self.walks.seed})
        text = f"# hexmj search: {self._title}\nsearched = {{ seeds = {seeds} }}\n{self._toml(problem, found)}"
        history = found.history.assign_attrs(title=self._title)
        files = [
            save(history, self.out / "history.nc"),
            write_text(self.out / FOUND, text),
            save_figure(convergence_figure, history, self.out / self._figure),
        ]
        return [*files, save_manifest(sys.argv[1:], settings, files, self.out / MANIFEST)]

    def _toml(self, problem: "Problem", found: "Found") -> str:
        """What `load_controller` reads to the same bits: weights, or a controller and its fields."""
        import tomli_w

        from hexmj.controllers.cruse1998.presets import network_toml
        from hexmj.controllers.named import parameter_file
        from hexmj.search.network_forms import NetworkForm

        if isinstance(problem.form, NetworkForm):
            return network_toml(problem.form.controller(found.vector))
        file = parameter_file(self.form)
        told = read_toml(file) if file else {"controller": self.form, "fields": {}}
        values = told.get("fields", {}) | dict(zip(problem.form.names, found.vector.tolist(), strict=True))
        return tomli_w.dumps({"controller": told["controller"], "fields": values})

    def _counted(self, problem: "Problem", found: "Found") -> str:
        """What the least cost is where it is no FLSS, and how many starts were lost at it."""
        if self.ties == "equal":
            return ""
        lost = "" if found.lost is None else f", at which {found.lost} of {found.starts} starts were lost"
        return f" ({problem.minimised}{lost})"

    def _show(
        self, problem: "Problem", found: "Found", verdict: "xr.Dataset", n_starts: int, files: list[Path]
    ) -> None:
        from hexmj.search.samples import REFUSED

        vectors = {name: _numbers(problem.form, loaded(one)) for name, one in self._beside.items()}
        rows = zip(problem.form.names, found.vector, *vectors.values(), strict=True)
        numbers = [(name.replace("_", " "), *(f"{value:.4g}" for value in values)) for name, *values in rows]
        refused = f"; {len(found.refused)} were refused, the first by {found.refused[0]}" if found.refused else ""
        if all_lost := int((found.history.cost.values >= REFUSED).sum()):
            where = " in a variant" if self.over == "worst" else ""
            refused = f"; {all_lost} cost 1: all of their starts were lost{where}, or they do not walk{refused}"
        over = f"{self.over} over {len(problem.variants)} variants of " if self.over != "usual" else ""
        observation_times = verdict.observation_time.values.tolist()
        judged = [
            (
                name,
                *(
                    interval(verdict.sel(controller=name, observation_time=observation_time), "flss")
                    for observation_time in observation_times
                ),
            )
            for name in verdict.controller.values.tolist()
        ]
        show(
            self._title,
            table(("parameter", "found", *vectors), numbers),
            f"{over}{self._kind} FLSS on {n_starts} fresh starts (seed {self.verdict_seed}), with 95 % intervals",
            table(
                (
                    "model",
                    *(
                        f"observation time {observation_time.removesuffix('.0')}"
                        for observation_time in observation_times
                    ),
                ),
                judged,
            ),
            f"{found.history.sizes['evaluation']} evaluations, {found.replayed} candidates known from an earlier run;"
            f" least cost {found.cost:.4g}{self._counted(problem, found)}{refused}",
            self.conditions_line(self.physical),
            *map(str, files),
        )


def _numbers(form: "Form", controller: "Controller") -> "np.ndarray":
    """The parameters of a controller, (parameter,), NaN where it has none of a name."""
    from hexmj.controllers.cruse1998 import Cruse1998
    from hexmj.search.network_forms import FORMS, NetworkForm

    if isinstance(form, NetworkForm) and isinstance(controller, Cruse1998):
        return FORMS[form.name].vector(controller.weights)
    return form.vector(controller)


def _judged(verdict: "xr.Dataset") -> dict[str, Any]:
    """FLSS and its interval by controller and observation time."""

    def one(name: str, observation_time: str) -> dict[str, float]:
        return {
            str(key): values.item()
            for key, values in verdict.sel(controller=name, observation_time=observation_time).items()
        }

    observation_times = verdict.observation_time.values.tolist()
    return {
        name: {observation_time: one(name, observation_time) for observation_time in observation_times}
        for name in verdict.controller.values.tolist()
    }
