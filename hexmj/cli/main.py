"""The command line: arguments in, one call to the package, and errors as one line with an exit code."""

import sys
from pathlib import Path
from typing import Any

from hexmj.cli.commands import COMMANDS, GOES_ON, options_of
from hexmj.errors import InputError, RenderingError, SimulationError


def main() -> None:
    """Run `hexmj`: exit code 2 for input that makes no sense, 1 for a failed simulation, 130 for Ctrl-C."""
    sys.path.append("")  # modules of the user in the current directory, as with `python -m hexmj`
    options: Any = None
    try:
        options = options_of(sys.argv[1:])
        options.run()
    except KeyboardInterrupt:
        resumes = getattr(options, "out", None) and GOES_ON in COMMANDS.get(sys.argv[1], "")
        _exit(f"stopped{f'. {GOES_ON}' if resumes else ''}", 130)
    except InputError as error:
        _exit(error, 2)
    except SimulationError as error:
        _exit(f"{error}{_saved(error, getattr(options, 'out', None))}", 1)
    except RenderingError as error:
        _exit(error, 1)


def _saved(error: SimulationError, out: Path | None) -> str:
    """Save the last finite state of a failed simulation and say how to replay it."""
    if not error.state or out is None:
        return ""
    from hexmj.physics.divergence import save_state

    return f"; replay its last finite state: python -m hexmj.physics.divergence {save_state(error, out)}"


def _exit(message: Exception | str, code: int) -> None:
    print(f"hexmj: {message}", file=sys.stderr)
    sys.exit(code)
