"""Scenes from TOML files; every error is one line with file, key, value and what is allowed."""

from pathlib import Path

from uwsim.files import find_shipped, read_toml
from uwsim.scene.models import Scene
from uwsim.validation import validated


def scene_values(name: str) -> tuple[dict, Path]:
    """Return a scene's raw values, with files made absolute, and the path they were read from."""
    path = find_shipped("scenes", name)
    values = read_toml(path)
    rig = values.get("rig")
    for entries, key in ((values.get("bodies"), "file"), (rig.get("lamps") if isinstance(rig, dict) else None, "ies")):
        for entry in entries if isinstance(entries, list) else ():
            if isinstance(entry, dict) and isinstance(entry.get(key), str):
                entry[key] = str((path.parent / entry[key]).resolve())
    return values, path


def load_scene(name: str) -> Scene:
    """Return a scene given by the path of a TOML file or by the name of a shipped one."""
    values, path = scene_values(name)
    return validated(Scene, values, where=path)
