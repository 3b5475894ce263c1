"""`hexmj biology`."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import STEADY, Accelerating, ControllerName, Walks, hiding
from hexmj.cli.study_command import Outputs, StudyCommand, lists_of
from hexmj.cli.tables import table
from hexmj.conditions import Conditions
from hexmj.files import write_text
from hexmj.studies import biology
from hexmj.studies.biology import HEADS, biology_figure, biology_markdown, table_rows

if TYPE_CHECKING:
    import xarray as xr

TABLE = "biology.md"
HIDDEN = ("grasp", "ground", "ground_height", "ground_at", "ground_length", "ground_seed")


@dataclass(frozen=True)
class Biology(StudyCommand):
    """Options of `hexmj biology`, which `commands.COMMANDS` describes."""

    model: ControllerName = "ldvs"
    starts: int = biology.Biology.n_starts
    """Number of random starts, the same at every speed."""
    periods: int = biology.Biology.periods
    """Periods of a single leg that each start walks; the last three are measured."""
    out: Path = Path("results/biology")
    walks: OmitArgPrefixes[Walks] = hiding(Walks(), ["observation_time"], "All walk so many periods.")
    accelerating: OmitArgPrefixes[Accelerating] = STEADY
    conditions: OmitArgPrefixes[Conditions] = hiding(Conditions(), HIDDEN)
    outputs = Outputs("walking beside the animal", "biology.nc", {"biology.png": biology_figure}, others=(TABLE,))

    def study(self) -> biology.Biology:
        return biology.Biology(
            self.controlled.controller(self.model),
            self.periods,
            n_starts=self.starts,
            **self.steady,
        )

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """The rows of the table."""
        return lists_of(result.drop_dims(("start", "speed", "quantity")))

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """The table, how many walked whole strides, and the conditions."""
        yield f"{self.controlled.controller(self.model).name} beside insects, at 24 mm/s unless told"
        yield table(HEADS, table_rows(result))
        yield f"starts with whole strides: {biology.walked_in_words(result)}; sources in {self.out / TABLE}"
        walks = replace(self.walks, observation_time=f"{self.periods} periods")
        yield replace(self, walks=walks).conditions_line()

    def write_others(self, result: "xr.Dataset") -> list[Path]:
        """The table as Markdown."""
        return [write_text(self.out / TABLE, biology_markdown(result))]
