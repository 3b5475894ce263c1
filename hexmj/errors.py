"""What can go wrong, each with one clear sentence."""


class InputError(Exception):
    """A value that makes no sense: says what was given, what is expected and the valid names."""


class SimulationError(RuntimeError):
    """A physical simulation that did not settle or diverged; it is never counted as an outcome."""


class RenderingError(RuntimeError):
    """No video can be rendered on this machine; names the package that brings it."""
