"""Settings of a film, and the encoder that writes its frames to an MP4 or GIF file."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hexmj.body import Body
from hexmj.errors import InputError, RenderingError, without_extra
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

    def check_camera(self, body: Body) -> None:
        """Raise InputError if a body does not have the camera."""
        choice("camera", self.camera, body.cameras)


def missing_encoder() -> str | None:
    """Return what to install before films can be encoded, or None."""
    if find_spec("imageio_ffmpeg") and find_spec("mediapy"):
        return None
    return str(without_extra("film", "mediapy or imageio-ffmpeg"))


@contextmanager
def encoder(path: Path, height: int, width: int, fps: float) -> Iterator[Callable[[np.ndarray], None]]:
    """Provide a function that adds a frame, (height, width, 3) of bytes, to a new film.

    Args:
        path: of the film, with a suffix of `ENCODINGS`.
        height: of a frame, even [pixels].
        width: of a frame, even [pixels].
        fps: frames per second.

    Raises:
        RenderingError: ffmpeg is missing or fails.
    """
    import imageio_ffmpeg
    import mediapy

    writer = mediapy.VideoWriter(path.absolute(), (height, width), fps=fps, **ENCODINGS[path.suffix])
    try:
        mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
        writer.__enter__()
    except (OSError, RuntimeError) as error:
        raise RenderingError(f"ffmpeg cannot be run: {error}. Reinstall imageio-ffmpeg.") from None
    try:
        with suppress(BrokenPipeError):  # ffmpeg ended early; `close` raises its reason
            yield writer.add_image
    except BaseException:
        with suppress(OSError, RuntimeError):
            writer.close()
        raise
    try:
        with suppress(BrokenPipeError):  # the second call raises the reason
            writer.close()
        writer.close()
    except RuntimeError as error:
        raise RenderingError(f"ffmpeg failed: {' '.join(str(error).split()):.300}") from None
