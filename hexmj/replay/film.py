"""Settings of a film, and the encoding of its frames as an MP4 or GIF file."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hexmj.errors import InputError, RenderingError
from hexmj.validate import choice, number, whole

MOST_PANELS = 6
"""Most recordings in one film."""

FASTEST_GIF = 50
"""Most frames per second of a GIF: it counts hundredths of a second, and players show one hundredth as ten."""

ENCODINGS: dict[str, dict[str, Any]] = {
    ".mp4": {"crf": 20, "ffmpeg_args": "-preset veryfast -movflags +faststart"},
    ".gif": {"codec": "gif"},
}
"""Suffix of a film's name -> options of the encoder."""


@dataclass(frozen=True)
class Film:
    """Camera, size, speed and quality of a video.

    Raises:
        InputError: a value is out of its range.
    """

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
        for name, most in (("width", 1920), ("height", 1080)):
            size = whole(name, getattr(self, name), 64, most)
            if size % 2:
                raise InputError(f"{name} = {size}; expected an even number of pixels")
        number("fps", self.fps, 1.0, 240.0)
        number("slow_motion", self.slow_motion, 0.001, 1000.0)
        choice("quality", self.quality, ("fast", "high"))

    def check_format(self, name: str) -> None:
        """Raise InputError if the film has more frames per second than a format allows: "mp4" or "gif"."""
        if name == "gif" and self.fps > FASTEST_GIF:
            raise InputError(f"fps = {self.fps:g}; a GIF has at most {FASTEST_GIF} frames per second")


def write_film(path: Path, frames: Iterable[np.ndarray], fps: float) -> None:
    """Encode frames, (height, width, 3) of bytes each, of even height and width, as a new film.

    Args:
        path: of the film, with a suffix of `ENCODINGS`.
        frames: in their order.
        fps: frames per second.

    Raises:
        RenderingError: ffmpeg is missing or fails.
    """
    import imageio_ffmpeg
    import mediapy

    try:
        mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
        mediapy.write_video(path.absolute(), frames, fps=fps, **ENCODINGS[path.suffix])
    except (OSError, RuntimeError) as error:
        raise RenderingError(f"ffmpeg failed: {' '.join(str(error).split()):.300}") from None
