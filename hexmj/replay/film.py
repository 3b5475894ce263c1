"""Settings of a film."""

from dataclasses import dataclass
from typing import Literal

from hexmj.errors import InputError
from hexmj.validate import choice, number, whole

MOST_PANELS = 6
"""Maximum number of recordings in one film."""

FASTEST_GIF = 50
"""Maximum frames per second of a GIF. It stores times in 1/100 s, and players show frames of 1/100 s for 10/100 s."""


@dataclass(frozen=True)
class Film:
    """Camera, size, speed and quality of a video.

    Raises:
        InputError: a value is out of its range.
    """

    camera: str = "following"
    """Camera of the body; the stick insect has following, side, top and front."""
    width: int = 640
    """Width of the picture of one recording [pixels], an even number."""
    height: int = 480
    """Height of the picture of one recording [pixels], an even number."""
    fps: float = 30.0
    """Frames per second."""
    slow_motion: float = 2.0
    """Factor by which the film is slower than the walk: 2 plays at half speed."""
    quality: Literal["fast", "high"] = "fast"
    """'fast' renders without shadows, reflections and multisampling; 'high' renders with them."""

    def __post_init__(self) -> None:
        for name, most in (("width", 1920), ("height", 1080)):
            if (size := whole(name, getattr(self, name), 64, most)) % 2:
                raise InputError(f"{name} = {size}; expected an even number of pixels")
        number("fps", self.fps, 1.0, 240.0)
        number("slow_motion", self.slow_motion, 0.001, 1000.0)
        choice("quality", self.quality, ("fast", "high"))

    def check_format(self, name: str) -> None:
        """Raise InputError if the film has more frames per second than the format `name`, "mp4" or "gif", allows."""
        if name == "gif" and self.fps > FASTEST_GIF:
            raise InputError(f"fps = {self.fps:g}; a GIF has at most {FASTEST_GIF} frames per second")
