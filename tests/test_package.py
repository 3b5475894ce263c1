"""Metadata of the package: one version everywhere, a citation, CI on all supported versions of Python."""

import tomllib
from pathlib import Path

import yaml

import hexmj

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_citation_has_the_version_and_names_the_paper():
    citation = yaml.safe_load(read("CITATION.cff"))
    assert citation["version"] == hexmj.__version__ and f"\n## {hexmj.__version__}" in read("CHANGELOG.md")
    assert citation["license"] == PROJECT["license"]
    (paper,) = citation["references"]
    assert [author["family-names"] for author in paper["authors"]] == ["Cymbalyuk", "Borisyuk", "Müller-Wilm", "Cruse"]
    assert (paper["journal"], paper["volume"], paper["year"]) == ("Neural Networks", 11, 1998)


def test_public_ci_calls_the_same_script_on_all_pythons():
    job = yaml.safe_load(read(".github/workflows/ci.yml"))["jobs"]["all"]
    assert any(step.get("run", "").endswith(".ci/run") for step in job["steps"])
    pythons = [f"Programming Language :: Python :: {version}" for version in job["strategy"]["matrix"]["python"]]
    assert set(pythons) < set(PROJECT["classifiers"])
