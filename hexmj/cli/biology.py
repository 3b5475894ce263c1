"""`hexmj biology`."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import STEADY, Accelerating, ControllerName, Walks, hiding
from hexmj.cli.study import Outputs, StudyCommand, lists_of
from hexmj.cli.tables import new_table
from hexmj.conditions import Conditions
from hexmj.storage.results import save_text
from hexmj.studies.biology import study as biology

if TYPE_CHECKING:
    import xarray as xr

TABLE = "biology.md"


@dataclass(frozen=True)
class _Walks(Walks):
    """All walk so many periods."""


@dataclass(frozen=True)
class Biology(StudyCommand):
    """Options of `hexmj biology`, which `main.COMMANDS` describes."""

    model: ControllerName = "ldvs"
    starts: int = biology.Biology.n_starts
    """Number of random starts, the same at every speed."""
    periods: int = biology.Biology.periods
    """Periods of a single leg that each start walks; the last three are measured."""
    out: Path = Path("results/biology")
    walks: OmitArgPrefixes[Walks] = field(default_factory=lambda: hiding(_Walks(), ["window"]))
    accelerating: OmitArgPrefixes[Accelerating] = STEADY
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=lambda: hiding(Conditions(), ["grasp"]))

    def study(self) -> biology.Biology:
        """See `StudyCommand.study`."""
        return biology.Biology(
            self.controlled.controller(self.model),
            self.periods,
            n_starts=self.starts,
            seed=self.walks.seed,
            conditions=self.conditions,
            stride=self.walks.stride,
        )

    def outputs(self) -> Outputs:
        """See `StudyCommand.outputs`."""
        from hexmj.studies.biology.figure import biology_figure

        figures = {"biology.png": biology_figure}
        return Outputs("walking beside the animal", "biology.nc", figures, others=(TABLE,))

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """The rows of the table."""
        return lists_of(result.drop_dims(("start", "speed", "quantity")))

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """The table, how many walked, and the conditions."""
        from hexmj.studies.biology.table import HEADS, rows

        table = new_table(*HEADS)
        for row in rows(result):
            table.add_row(*row)
        yield f"{self.controlled.controller(self.model).name} beside insects, at 24 mm/s unless told"
        yield table
        counts = (f"{n} of {self.starts} at {speed:g} mm/s" for speed, n in biology.walked(result).items())
        yield f"starts that walked: {', '.join(counts)}; sources in {self.out / TABLE}"
        walks = replace(self.walks, window=f"{self.periods} periods")
        yield replace(self, walks=walks).conditions_line()

    def write_others(self, result: "xr.Dataset") -> list[Path]:
        """The table as Markdown."""
        from hexmj.studies.biology.table import biology_markdown

        return [save_text(biology_markdown(result), self.out / TABLE)]
