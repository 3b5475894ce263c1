"""Frames to an MP4 or GIF file, by mediapy and ffmpeg."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from signal import strsignal
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import RenderingError, without_extra

if TYPE_CHECKING:
    import mediapy

HOW: dict[str, dict[str, Any]] = {
    ".mp4": {"crf": 20, "ffmpeg_args": "-preset veryfast -movflags +faststart"},
    ".gif": {"codec": "gif"},
}
"""End of a film's name -> how it is encoded."""


def missing() -> str | None:
    """What brings the libraries that encode films, in one sentence; None if they are there."""
    both = find_spec("imageio_ffmpeg") and find_spec("mediapy")
    return None if both else str(without_extra("film", "mediapy or imageio-ffmpeg, which films need,"))


@contextmanager
def encoder(path: Path, height: int, width: int, fps: float) -> Iterator[Callable[[np.ndarray], None]]:
    """What takes the frames of a film one after the other, (height, width, 3) of bytes; height and width are even.

    The path has an ending of `HOW`; what stands there is overwritten.

    Raises:
        OSError: the film cannot be written; with what ffmpeg says of it.
        RenderingError: there is no ffmpeg.
    """
    import imageio_ffmpeg
    import mediapy

    writer = mediapy.VideoWriter(path.absolute(), (height, width), fps=fps, **HOW[path.suffix])
    try:
        mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
        writer.__enter__()
    except (OSError, RuntimeError) as error:
        raise RenderingError(f"ffmpeg cannot be run ({error}); reinstall imageio-ffmpeg") from None
    try:
        yield writer.add_image
    finally:
        _close(writer)


def _close(writer: "mediapy.VideoWriter") -> None:
    try:
        try:
            writer.close()
        except BrokenPipeError:  # ffmpeg has ended; once more, to be told why
            writer.close()
    except RuntimeError as error:
        code = writer._proc.returncode if writer._proc else 0
        if writer._popen:
            writer._popen.__exit__(None, None, None)  # mediapy leaves its pipes open where ffmpeg fails
        if said := str(error).removeprefix(f"Error writing '{writer.path}':").strip():
            raise OSError(said.splitlines()[-1].rpartition(": ")[2]) from None
        why = strsignal(-code) if code < 0 else f"with exit code {code}"
        raise OSError(f"ffmpeg ended ({why})") from None
