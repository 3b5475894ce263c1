"""Run the notebooks anew and store what they show: `python notebooks/run.py`."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parent
LIMIT = 120
"""Time for a cell [s]."""

QUIETLY = ["--log-level=ERROR"]
"""For a kernel, which would warn that it is spoken to without encryption, by this machine alone."""


def executed(path: Path) -> Any:
    """A notebook with what its cells show, without the times at which they ran."""
    book = nbformat.read(path, as_version=4)
    place = {"metadata": {"path": str(FOLDER)}}
    NotebookClient(book, timeout=LIMIT, record_timing=False, resources=place, extra_arguments=QUIETLY).execute()
    for cell in book.cells:
        cell.metadata.pop("execution", None)
    book.metadata.language_info = {"name": "python"}
    return book


if __name__ == "__main__":
    ArgumentParser(description=__doc__).parse_args()
    for path in sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(executed(path), path)
        print(path.name, f"{path.stat().st_size / 1000:.0f} kB")
