"""`hexmj doctor`."""

from dataclasses import dataclass

from hexmj.cli.findings import report


@dataclass(frozen=True)
class Doctor:
    """Options of `hexmj doctor`, which `commands.COMMANDS` describes."""

    json: bool = False
    """Print one JSON object on standard output, nothing else."""

    def run(self) -> None:
        """One line for each check."""
        from hexmj.cli.machine_checks import examine

        report(examine(), self.json)
