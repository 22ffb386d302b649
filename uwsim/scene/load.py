"""Scenes from TOML files; every error is one line with file, key, value and what is allowed."""

import tomllib
from pathlib import Path

from uwsim.files import find_shipped
from uwsim.scene.models import Scene
from uwsim.validation import validated


def read_toml(path: Path) -> dict:
    """Read a TOML file as a dictionary; ValueError in one line."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path}: not readable as TOML: {error}") from None


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
