"""The command `hexmj`, also as `python -m hexmj`."""


def main() -> None:
    """Run the command line."""
    from hexmj.cli.main import main as command

    command()


if __name__ == "__main__":
    main()
