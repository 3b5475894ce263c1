"""Which way MuJoCo renders is settled before it is imported, and never stands in the way of numbers."""

import ctypes
import os

import pytest

from hexmj.film import gl

SCREENS = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")


@pytest.fixture
def environment(monkeypatch):
    for name in SCREENS:
        monkeypatch.delenv(name, raising=False)
    return monkeypatch


def without_libraries(name: str) -> None:
    raise OSError(f"{name}: cannot open shared object file")


def test_egl_is_taken_where_there_is_no_screen(environment):
    gl.prefer_egl()
    assert os.environ["MUJOCO_GL"] == "egl"


@pytest.mark.parametrize(("name", "value"), [("MUJOCO_GL", "osmesa"), ("DISPLAY", ":0")])
def test_other_wishes_stand(environment, name, value):
    environment.setenv(name, value)
    gl.prefer_egl()
    assert {key: os.environ[key] for key in SCREENS if key in os.environ} == {name: value}


@pytest.mark.parametrize("wish", [None, "egl"])
def test_without_the_libraries_nothing_is_asked_of_mujoco(environment, wish):
    """MuJoCo cannot be imported where EGL is asked for and missing."""
    if wish:
        environment.setenv("MUJOCO_GL", wish)
    environment.setattr(ctypes, "CDLL", without_libraries)
    gl.prefer_egl()
    assert "MUJOCO_GL" not in os.environ
