"""Scenes from TOML files; every error is one line with file, key, value and what is allowed."""

import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from uwsim.files import find_shipped
from uwsim.scene.models import Scene

Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path) -> dict:
    """Read a TOML file as a dictionary; ValueError in one line."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path}: not readable as TOML: {error}") from None


def validated(model: type[Model], values: dict, *, where: object) -> Model:
    """Fill a strict model; ValueError in one line naming file, key, value and what is allowed."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise ValueError(f"{where}: {first_problem(error)}") from None


def first_problem(error: ValidationError) -> str:
    """Return the first problem of a validation as `key: message (got ...)`; of a union, the branch that fits best."""
    problems = error.errors(include_url=False)
    # a union reports every branch; unknown and missing keys tell least about what was meant
    problem = min(problems, key=lambda p: p["type"] in ("extra_forbidden", "missing") and len(problems) > 1)
    key = ".".join(str(part) for part in problem["loc"] if not _is_branch(part))
    message = problem["msg"].removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        message = "unknown key"
    elif problem["type"] == "missing":
        return f"{key}: missing"
    got = problem["input"]
    shown = f" (got {got!r})" if isinstance(got, str | int | float | bool | list | tuple) else ""
    return " ".join(f"{key or 'file'}: {message}{shown[:120]}".split())


def _is_branch(part) -> bool:
    """Whether an entry of a location names a branch of a union rather than a key."""
    return isinstance(part, str) and (part[:1].isupper() or "[" in part or part in ("float", "str", "int"))


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
