"""Run the notebooks and store their output: `python docs/tutorials/run.py`."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parent
LIMIT = 120
"""Time for a cell [s]."""

QUIET = ["--log-level=ERROR"]
"""Arguments of a kernel, which otherwise warns about its unencrypted local connection."""


def executed(path: Path) -> Any:
    """Return a notebook with the output of its cells, without times."""
    book = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(FOLDER)}}
    NotebookClient(book, timeout=LIMIT, record_timing=False, resources=resources, extra_arguments=QUIET).execute()
    for cell in book.cells:
        cell.metadata.pop("execution", None)
    book.metadata.language_info = {"name": "python"}
    return book


if __name__ == "__main__":
    ArgumentParser(description=__doc__).parse_args()
    for path in sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(executed(path), path)
        print(path.name, f"{path.stat().st_size / 1000:.0f} kB")
