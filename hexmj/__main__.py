"""The command `hexmj`, also as `python -m hexmj`: it can be stopped from its first moment on."""

import signal
import sys

STOPS = [signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
"""What stops the command as Ctrl-C does."""


def main() -> None:
    """Run the command line; Ctrl-C, SIGTERM and a terminal that closes stop it, exit code 130."""
    try:
        for one in STOPS:
            if signal.getsignal(one) != signal.SIG_IGN:  # as `nohup` has it
                signal.signal(one, signal.default_int_handler)
        from hexmj.cli.main import main as command

        command()
    except KeyboardInterrupt:
        print("hexmj: stopped", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
