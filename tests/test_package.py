"""What people expect of a package beside its code: one version everywhere, a citation, files that are where they are
said to be."""

import pydoc
import re
import subprocess
import sys
import tomllib
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
import yaml

import hexmj

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_one_version():
    assert f"\n## {hexmj.__version__}, " in read("CHANGELOG.md")
    assert yaml.safe_load(read("CITATION.cff"))["version"] == hexmj.__version__


def test_the_citation_has_what_its_format_wants_and_names_the_paper():
    cited = yaml.safe_load(read("CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= set(cited)
    assert cited["license"] == PROJECT["license"]
    (paper,) = cited["references"]
    assert {"type", "title", "authors"} <= set(paper)
    assert [author["family-names"] for author in paper["authors"]] == ["Cymbalyuk", "Borisyuk", "Müller-Wilm", "Cruse"]
    assert (paper["journal"], paper["volume"], paper["year"]) == ("Neural Networks", 11, 1998)


def test_public_ci_calls_the_same_script_on_all_pythons():
    job = yaml.safe_load(read(".github/workflows/ci.yml"))["jobs"]["all"]
    assert any(step.get("run", "").endswith(".ci/run") for step in job["steps"])
    pythons = [f"Programming Language :: Python :: {one}" for one in job["strategy"]["matrix"]["python"]]
    assert set(pythons) < set(PROJECT["classifiers"])


def test_types_are_told():
    assert Path(hexmj.__file__).with_name("py.typed").exists()


def test_the_readme_fits_on_two_screens():
    assert len(read("README.md").splitlines()) <= 125


def cited() -> list[str]:
    """Files of docs/ that any file of the project names."""
    listed = subprocess.run(["git", "grep", "-IhoE", r"docs/\w+(/\w+)*\.(md|png|webp)"], cwd=ROOT, capture_output=True)
    return sorted(set(listed.stdout.decode().split()))


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a clone")
def test_pages_that_are_cited_are_there():
    names = cited()
    assert len(names) > 10
    assert [name for name in names if not (ROOT / name).exists()] == []


def test_pages_link_to_pages_that_are_there():
    """From README and CONTRIBUTING, which MkDocs does not check."""
    for name in ("README.md", "CONTRIBUTING.md"):
        for link in re.findall(r"\]\((?!https?:)([^)#]+)", read(name)):
            assert (ROOT / link).exists(), link


def test_help_tells_what_fields_are():
    text = pydoc.render_doc(hexmj.Conditions)
    assert "vp: Velocity V_p of a protracting tip relative to the body [mm/s]; links the plan's time unit" in text
    assert "load: Weight carried at O" in pydoc.render_doc(type(hexmj.Conditions().masses))
    assert "foot: The site at its tip" in pydoc.render_doc(type(hexmj.STICK_INSECT.legs[0]))
    public = [one for name in hexmj.__all__ if isinstance(one := getattr(hexmj, name), type) and is_dataclass(one)]
    assert len(public) > 10
    for one in public:
        for field in fields(one):
            assert re.search(rf"^    {field.name}: (?!<class)", one.__doc__ or "", re.MULTILINE), (one, field.name)


def test_parts_that_the_pages_name_are_there_by_one_import():
    code = (
        "import hexmj; hexmj.gaits.limit_gait, hexmj.sweep.run_study, hexmj.controllers.Controller, hexmj.environments"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
