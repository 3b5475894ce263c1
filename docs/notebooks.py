"""Show the tutorials' notebooks as pages of the site; `python docs/notebooks.py` runs them and stores their output."""

import os
import re
import sys
from base64 import b64decode
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files


class NotebookPage(File):
    """A notebook as a page in Markdown."""

    def is_documentation_page(self) -> bool:
        """Return True, which is the default only for the suffixes of Markdown."""
        return True


def on_files(files: Files, *, config: MkDocsConfig) -> None:
    """Replace each notebook by a page and the pictures of its output."""
    for file in [file for file in files if file.src_uri.endswith(".ipynb")]:
        parts = []
        for number, cell in enumerate(nbformat.reads(file.content_string, as_version=4).cells):
            parts.append(cell.source if cell.cell_type == "markdown" else f"```python\n{cell.source}\n```")
            for output in cell.get("outputs", []):
                data = output.get("data") or {"text/plain": output.text}
                text = data.get("text/html", "").replace(' border="1" class="dataframe"', "")
                if "image/png" in data:
                    picture = f"{file.name}-{number}.png"
                    text = f"![Output of the code above]({picture})"
                    content = b64decode(data["image/png"])
                    files.append(File.generated(config, f"{Path(file.src_uri).parent}/{picture}", content=content))
                plain = re.sub(r"\x1b\[[\d;]*m", "", data.get("text/plain", "")).strip()  # without colours
                inner = text or f"```text\n{plain}\n```"
                parts.append(f'<div class="output"{"" if "text/html" in data else " markdown"}>\n{inner}\n</div>')
        files.remove(file)
        files.append(NotebookPage.generated(config, file.src_uri, content="\n\n".join(parts)))


def executed(path: Path) -> Any:
    """Return a notebook with the output of its cells, run in an empty folder, without times."""
    from nbclient import NotebookClient

    book, log = nbformat.read(path, as_version=4), ["--log-level=ERROR"]  # no warnings about the local connection
    search = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}  # to find the command hexmj
    with TemporaryDirectory() as folder:
        settings: Any = {"resources": {"metadata": {"path": folder}}, "record_timing": False, "coalesce_streams": True}
        client = NotebookClient(book, timeout=120, extra_arguments=log, **settings)
        client.execute(env={"MUJOCO_GL": "egl", **os.environ, **search})
    book.metadata.language_info = {"name": "python"}
    return book


if __name__ == "__main__":
    for path in map(Path, sys.argv[1:] or sorted(Path(__file__).parent.glob("tutorials/*.ipynb"))):
        nbformat.write(executed(path), path)
