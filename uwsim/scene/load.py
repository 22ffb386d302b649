"""Scenes from TOML files; every error is one line with file, key, value and what is allowed."""

from pathlib import Path

from uwsim.files import find_shipped, read_toml
from uwsim.scene.models import Scene
from uwsim.validation import validated


def scene_values(name: str) -> tuple[dict, Path]:
    """Return a scene's raw values, with files made absolute, and the path they were read from."""
    path = find_shipped("scenes", name)
    values = read_toml(path)
    for body in values.get("bodies", ()) if isinstance(values.get("bodies"), list) else ():
        if isinstance(body, dict) and isinstance(body.get("file"), str):
            body["file"] = str((path.parent / body["file"]).resolve())
    return values, path


def load_scene(name: str) -> Scene:
    """Return a scene given by the path of a TOML file or by the name of a shipped one."""
    values, path = scene_values(name)
    return validated(Scene, values, where=path)
