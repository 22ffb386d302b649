"""Find the files that extend the project: the folder is the registry."""

import importlib
import importlib.util
import pkgutil
from pathlib import Path
from types import ModuleType


def names(package: ModuleType) -> list[str]:
    """Return the names of the extension files of a package, sorted."""
    return sorted(info.name for info in pkgutil.iter_modules(package.__path__))


def discover(package: ModuleType) -> dict[str, ModuleType]:
    """Import every module of a package and return it by file name.

    A file that fails to import stops the program: a broken extension must not silently disappear.
    """
    return {name: importlib.import_module(f"{package.__name__}.{name}") for name in names(package)}


def find(package: ModuleType, name: str) -> ModuleType:
    """Return one extension by its name, or by the path of a user's own `.py` file.

    Raises ValueError naming the known ones if it does not exist.
    """
    if name.endswith(".py"):
        return load_file(Path(name))
    if name not in names(package):
        raise ValueError(
            f"{package.__name__.rpartition('.')[2]}: got {name!r}, allowed: {', '.join(names(package))}, "
            "or the path of a .py file"
        )
    return importlib.import_module(f"{package.__name__}.{name}")


def load_file(path: Path) -> ModuleType:
    """Import a user's own file; its stem is its name in tables.

    Raises ValueError if the file is missing or fails to import.
    """
    if not path.is_file():
        raise ValueError(f"algorithm file: got {path}, which does not exist")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise ValueError(f"{path}: does not import: {type(error).__name__}: {error}") from error
    return module


def missing_packages(module: ModuleType) -> list[str]:
    """Return the optional packages that a module lists in REQUIRES and that are not installed."""
    return [name for name in getattr(module, "REQUIRES", ()) if importlib.util.find_spec(name) is None]
