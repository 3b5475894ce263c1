"""Controllers of a command by name."""

from functools import cache

from hexmj.controllers.protocol import Controller


@cache
def loaded(name: str) -> Controller:
    """A controller by its name; names and errors as of `load_controller`."""
    from hexmj.controllers.named import load_controller

    return load_controller(name)


@cache
def seeds_of_searches(name: str) -> dict[str, list[int]]:
    """The seeds of the searches that found it; see `searched_on`."""
    from hexmj.controllers.searched import searched_on

    return searched_on(name, loaded(name))
