"""The command `hexmj`, also as `python -m hexmj`: it can be stopped from its first moment on."""

import signal
import sys


def main() -> None:
    """Run the command line; Ctrl-C and SIGTERM stop it, exit code 130."""
    try:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        from hexmj.cli.main import main as command

        command()
    except KeyboardInterrupt:
        print("hexmj: stopped", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
