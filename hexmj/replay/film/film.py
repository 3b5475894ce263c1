"""How a walk is filmed."""

from dataclasses import dataclass
from typing import Literal

from hexmj.body import Body
from hexmj.checks import check_types
from hexmj.errors import InputError

MOST_PANELS = 6
"""Recordings in one film, at most."""

FASTEST_GIF = 50
"""Frames per second of a GIF, at most: it counts hundredths of a second, and players take a single one for ten."""


@dataclass(frozen=True)
class Film:
    """Camera, size, speed and quality of a video."""

    camera: str = "following"
    """One of `Body.cameras`: following, side, top, front of the stick insect."""
    width: int = 640
    """Width of a panel [pixels], even."""
    height: int = 480
    """Height of a panel [pixels], even."""
    fps: float = 30.0
    """Frames per second of play."""
    slow_motion: float = 2.0
    """Play time over physical time: 2 plays at half speed."""
    quality: Literal["fast", "high"] = "fast"
    """'fast': no shadows, reflections or multisampling; 'high': all of them."""

    def __post_init__(self) -> None:
        check_types(self)
        for name, size, most in (("width", self.width, 1920), ("height", self.height, 1080)):
            if not (64 <= size <= most and size % 2 == 0):
                raise InputError(f"{name} = {size}; expected an even number of pixels from 64 to {most}")
        for name, value, least, most in (("fps", self.fps, 1, 240), ("slow_motion", self.slow_motion, 0.001, 1000)):
            if not least <= value <= most:
                raise InputError(f"{name} = {value}; expected {least} to {most}")

    def check_format(self, name: str) -> None:
        """Refuse more frames per second than films of a format can have.

        Raises:
            InputError: there are.
        """
        if name == "gif" and self.fps > FASTEST_GIF:
            raise InputError(f"fps = {self.fps:g} of a GIF; expected at most {FASTEST_GIF}, since no player shows more")

    def check_camera(self, body: Body) -> None:
        """Refuse a camera that a body has not.

        Raises:
            InputError: it is one.
        """
        if self.camera not in body.cameras:
            cameras = ", ".join(body.cameras) or "none"
            raise InputError(f"camera = {self.camera!r:.80}; valid names of {body.name}: {cameras}")
