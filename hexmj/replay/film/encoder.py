"""Frames to an MP4 file, by ffmpeg."""

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

import imageio_ffmpeg
import numpy as np

from hexmj.errors import RenderingError

INPUT = "-v error -f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {fps} -i -"
FILM = "-an -vcodec h264 -pix_fmt yuv420p -vb 0 -crf 20 -preset veryfast -movflags +faststart -y"


@contextmanager
def encoder(path: Path, height: int, width: int, fps: float) -> Iterator[Callable[[np.ndarray], None]]:
    """What takes the frames of a film, (height, width, 3) of bytes, one after the other.

    Args:
        path: of the film; what stands there is overwritten.
        height: of a frame [pixels], even.
        width: of a frame [pixels], even.
        fps: frames per second.

    Raises:
        OSError: the film cannot be written; with what ffmpeg says of it.
        RenderingError: there is no ffmpeg.
    """
    options = [*INPUT.format(height=height, width=width, fps=fps).split(), *FILM.split()]
    with TemporaryFile() as said:
        try:
            # An absolute path is no protocol, and with a session of its own no Ctrl-C at the terminal reaches it.
            ffmpeg = subprocess.Popen(
                [imageio_ffmpeg.get_ffmpeg_exe(), *options, str(path.absolute())],
                stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said, start_new_session=True,
            )  # fmt: skip
        except (OSError, RuntimeError) as error:
            raise RenderingError(f"ffmpeg cannot be run ({error}); reinstall imageio-ffmpeg") from None
        frames = ffmpeg.stdin
        assert frames

        def end() -> None:
            with suppress(BrokenPipeError):
                frames.close()
            if ffmpeg.wait():
                said.seek(0)
                lines = said.read().decode(errors="replace").splitlines() or [f"ffmpeg ended with {ffmpeg.returncode}"]
                raise OSError(lines[-1].rpartition(": ")[2])

        def add(frame: np.ndarray) -> None:
            try:
                frames.write(frame.tobytes())
            except BrokenPipeError:
                end()
                raise

        try:
            yield add
            end()
        finally:
            ffmpeg.kill()
            ffmpeg.wait()
            with suppress(BrokenPipeError):
                frames.close()
