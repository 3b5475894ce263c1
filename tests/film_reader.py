"""Reads a real video file back, frame by frame.

By ffmpeg itself: imageio-ffmpeg's reader leaves files open.
"""

import re
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np


def read_film(path: Path) -> tuple[np.ndarray, float]:
    """All frames, (frame, height, width, 3), and frames per second."""
    decode = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(decode, capture_output=True, check=True)
    video = re.search(rb"Video: h264.*?, (\d+)x(\d+).*?, ([\d.]+) fps", done.stderr)
    assert video, done.stderr
    width, height = int(video[1]), int(video[2])
    return np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3), float(video[3])
