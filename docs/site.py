"""What the site does beyond MkDocs: a page for every name of `mkdocs.yml`, and pictures that open at full size."""

import re

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

LATER = {
    "clusters.md": "# Clusters\n\nEvery sweep takes an executor; [sweeps](reference/sweeps.md) tell how.\n",
    "learning.md": "# Learning\n\nThe insect is an [environment](reference/environments.md) for learning.\n",
    "page_and_view.md": "# Page and view\n\nA recording becomes a film; see [films](films.md).\n",
}
"""Pages that may not be there yet -> what stands in their place."""


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Pages that are missing get one sentence."""
    for name, text in LATER.items():
        if files.get_file_from_path(name) is None:
            files.append(File.generated(config, name, content=text))
    return files


def on_page_content(html: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """A picture is a link to itself."""
    return re.sub(r'<img [^>]*src="([^"]+)"[^>]*>', r'<a href="\1">\g<0></a>', html)
