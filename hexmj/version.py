"""Of this package, for whoever asks and for what installs it."""

__version__ = "0.5.0"
