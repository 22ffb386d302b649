"""Imports run only downwards: each one in uwsim/ is read with `ast` and held against the table of layers."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import uwsim

PACKAGE = Path(uwsim.__file__).parent

LEAVES = {"images", "look", "seeds", "discovery", "files", "provenance", "validation", "workers"}
# the half of the dataset folder that reads and writes; whoever may read datasets may import all of it
STORE = {"dataset.store", "dataset.frame", "dataset.info", "dataset.parts", "dataset.exr", "dataset.sequence"}

# folder or module at the top of uwsim: what it may import beside itself and the leaves
RULES: dict[str, set[str]] = {
    **dict.fromkeys(LEAVES, set()),
    "optics": set(),
    "camera": {"optics"},
    "scene": {"optics", "camera"},
    "formation": {"optics", "camera"},
    "render": {"optics", "camera", "scene"},
    "dataset": {"optics", "camera", "scene", "formation", "render"},
    "restoration": {"optics", "camera", "formation"},
    "motion_blur": set(),
    "pose": {"optics", "camera"},
    "learning": {"restoration", "motion_blur", "dataset.store"},
    "metrics": set(),
    "progress": set(),
    "export": {"camera", "dataset.store", "dataset.frame", "dataset.info", "dataset.parts", "dataset.sequence"},
    "gallery": {"camera", "dataset.store", "dataset.frame", "dataset.info"},
    "bench": {
        "optics",
        "camera",
        "formation",
        "dataset.store",
        "dataset.frame",
        "dataset.info",
        "restoration",
        "motion_blur",
        "pose",
        "learning",
        "metrics",
    },
}
# modules with a rule of their own, and two packages' __init__, which run before any of their modules
NARROW: dict[str, set[str]] = dict.fromkeys(("", *LEAVES), set()) | dict.fromkeys(("dataset", *STORE), STORE)
# the command line and what its commands do; nothing below may import either
EVERYTHING = {"cli", "commands", "demonstration", "optics_page", "photographs", "summaries", "__main__"}
RENDERER = {"mitsuba", "drjit"}


def violations(package: Path) -> list[str]:
    """Return one line for each forbidden import and each folder without a rule below a package's folder."""
    files = {_module_name(package, path): path for path in sorted(package.rglob("*.py"))}
    found = []
    for module, path in files.items():
        top = module.partition(".")[0]
        if top and top not in RULES and top not in EVERYTHING:
            found.append(f"{top}: has no rule in the table of layers")
            continue
        is_package = path.name == "__init__.py"
        for line, name in _imports(ast.parse(path.read_text(encoding="utf-8")), module, is_package, files):
            if not _allowed(module, name):
                found.append(f"{module}, line {line}: imports {name}")
    return list(dict.fromkeys(found))


def _module_name(package: Path, path: Path) -> str:
    """Return the dotted name below the package; that of an __init__.py is its folder's."""
    return ".".join(path.relative_to(package).with_suffix("").parts).removesuffix("__init__").rstrip(".")


def _allowed(module: str, name: str) -> bool:
    root, _, target = name.partition(".")
    top = module.partition(".")[0]
    if root in RENDERER:
        return top == "render"
    if root != "uwsim" or not target or top in EVERYTHING:
        return True
    if target in LEAVES:
        return True
    if module in NARROW:
        return target in NARROW[module]
    granted = RULES[top] | {top}
    if target == "dataset":  # its __init__ alone, which NARROW keeps light
        return "dataset" in granted or "dataset.store" in granted
    return any(target == one or target.startswith(f"{one}.") for one in granted)


def _imports(tree: ast.Module, module: str, is_package: bool, files: dict) -> Iterator[tuple[int, str]]:
    """Yield (line, absolute dotted name) of each import: statements at any depth, calls with a constant."""
    here = ["uwsim", *module.split(".")] if module else ["uwsim"]
    parent = here if is_package else here[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = ".".join([*parent[: len(parent) - node.level + 1], *filter(None, [base])])
            for alias in node.names:
                full = f"{base}.{alias.name}"
                # `from uwsim.dataset import open` names no module: what runs is uwsim.dataset
                is_module = full.removeprefix("uwsim.") in files or (base == "uwsim" and alias.name in RULES)
                yield node.lineno, full if is_module else base
        elif isinstance(node, ast.Call) and (name := _constant_import(node, ".".join(parent))):
            yield node.lineno, name


def _constant_import(call: ast.Call, package: str) -> str | None:
    """Return what importlib.import_module("...") or __import__("...") imports, None for other calls."""
    function = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if function not in ("import_module", "__import__"):
        return None
    given = [*call.args, *(word.value for word in call.keywords if word.arg == "name")]
    if not given or not isinstance(given[0], ast.Constant) or not isinstance(given[0].value, str):
        return None
    name = given[0].value
    if not name.startswith("."):
        return name
    anchors = [*given[1:], *(word.value for word in call.keywords if word.arg == "package")]
    anchor = anchors[0].value if anchors and isinstance(anchors[0], ast.Constant) else package
    dots = len(name) - len(name.lstrip("."))
    parts = anchor.split(".")
    return ".".join([*parts[: len(parts) - dots + 1], name.lstrip(".")])


def test_every_import_runs_downwards():
    assert violations(PACKAGE) == []


def plant(root: Path, files: dict[str, str]) -> Path:
    """Write a package in which every folder has an empty __init__.py beside the given files."""
    package = root / "uwsim"
    for name, text in files.items():
        path = package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for folder in [package, *(path for path in package.rglob("*") if path.is_dir())]:
        (folder / "__init__.py").touch()
    return package


@pytest.mark.parametrize(
    ("file", "code"),
    [
        ("optics/water.py", "from uwsim.camera import sensor"),
        ("optics/water.py", "import uwsim.camera.sensor as s"),
        ("optics/water.py", "from uwsim import camera"),
        ("optics/water.py", "from .. import camera"),
        ("optics/types/deep.py", "from ...camera.sensor import shoot"),
        ("optics/__init__.py", "from ..camera import sensor"),
        ("optics/water.py", "def f():\n    from uwsim.scene import model"),
        ("optics/water.py", "class A:\n    if True:\n        import uwsim.scene"),
        ("optics/water.py", "import importlib\nimportlib.import_module('uwsim.camera')"),
        ("optics/water.py", "from importlib import import_module\nimport_module(name='uwsim.camera')"),
        ("optics/water.py", "import_module('..camera', package='uwsim.optics')"),
        ("optics/water.py", "import_module('..camera', __package__)"),
        ("optics/water.py", "__import__('uwsim.camera')"),
        ("optics/water.py", "import mitsuba as mi"),
        ("dataset/generate.py", "def f():\n    import drjit.llvm"),
        ("bench/run.py", "importlib.import_module('mitsuba')"),
        ("cli.py", "def f():\n    import mitsuba"),
        ("images.py", "from uwsim.optics import water"),
        ("__init__.py", "from uwsim import cli"),
        ("bench/run.py", "from uwsim.progress import bar"),
        ("dataset/store.py", "from uwsim.camera import sensor"),
        ("dataset/store.py", "from uwsim.dataset import generate"),
        ("dataset/frame.py", "from uwsim.render import llvm"),
        ("dataset/exr.py", "from . import generate"),
        ("dataset/__init__.py", "from uwsim.dataset.generate import make"),
        ("bench/run.py", "from uwsim.dataset import generate"),
        ("bench/run.py", "from uwsim import render"),
        ("bench/run.py", "import uwsim.scene"),
        ("restoration/algorithms/udcp.py", "from uwsim.dataset import store"),
        ("learning/train.py", "from uwsim.dataset.generate import make"),
        ("metrics/color.py", "from uwsim.formation import akkaynak"),
        ("stuff/new.py", "x = 1"),
        ("stray.py", "x = 1"),
    ],
)
def test_a_planted_violation_is_caught(tmp_path, file, code):
    others = ("camera/sensor.py", "scene/model.py", "dataset/generate.py", "dataset/store.py", "cli.py")
    package = plant(tmp_path, dict.fromkeys(others, "") | {file: code})
    assert len(violations(package)) == 1


@pytest.mark.parametrize(
    ("file", "code"),
    [
        (
            "optics/water.py",
            "import numpy\nfrom uwsim.files import shipped\nfrom uwsim import images, __version__",
        ),
        ("optics/water.py", "from . import tables\nfrom uwsim.optics.tables import x"),
        ("optics/water.py", "import_module(name)\nimport_module(f'uwsim.{name}')"),
        ("optics/water.py", "import mitsubas"),
        ("camera/port.py", "from uwsim import optics\nfrom ..optics.tables import x"),
        ("render/llvm.py", "import mitsuba\nimport drjit as dr"),
        ("dataset/generate.py", "from uwsim.render import scenes\nfrom uwsim.dataset import store"),
        (
            "dataset/store.py",
            "from uwsim.dataset.frame import Frame\nfrom . import exr\nfrom uwsim import files",
        ),
        ("dataset/__init__.py", "from uwsim.dataset.store import open"),
        ("bench/run.py", "from uwsim.dataset import store, frame\nfrom uwsim.pose import solvers"),
        ("bench/run.py", "import uwsim.dataset\nfrom uwsim.dataset import open"),
        ("cli.py", "from uwsim.render import doctor\nfrom uwsim.bench import run"),
    ],
)
def test_an_allowed_import_passes(tmp_path, file, code):
    stores = ("dataset/generate.py", "dataset/store.py", "dataset/frame.py", "dataset/info.py", "dataset/exr.py")
    others = ("optics/tables.py", "files.py", *stores)
    package = plant(tmp_path, dict.fromkeys(others, "") | {file: code})
    assert violations(package) == []
