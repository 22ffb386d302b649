"""Select a Mitsuba variant with a usable libLLVM, and register this project's plugins with it."""

import contextlib
import ctypes.util
import importlib
import os
import pkgutil
import sys
from pathlib import Path
from types import ModuleType

from uwsim.files import no_stderr
from uwsim.render import llvm, packages, plugins

DEFAULT = "llvm_ad_spectral"
GEOMETRY_ONLY = "scalar_spectral"

_active: str | None = None


def use(variant: str | None = None, *, geometry: bool = False) -> str:
    """Make a Mitsuba variant active, define every plugin against it, and return its name.

    variant: "llvm_ad_spectral" if None; with `geometry=True` (rays and buffers, no light transport) None
        means "scalar_spectral" where no usable libLLVM exists. The active variant again: does nothing.

    Plugins are loaded for compiled variants (llvm, cuda) only: a Python plugin of a scalar variant is called
    once per ray, too slow to be of use. A scalar variant therefore has Mitsuba's own plugins and no others.

    Raises ValueError for an unknown variant, and where libLLVM, another library of Dr.Jit's or the NVIDIA
    driver is missing.
    """
    global _active
    choice = llvm.prepare()
    if variant is None:
        variant = GEOMETRY_ONLY if geometry and choice.path is None else DEFAULT
    _require_backend(variant, choice)
    mi = _import_mitsuba(quietly=choice.path is None)
    if variant not in mi.variants():
        raise ValueError(f"variant: got {variant!r}, allowed: {', '.join(mi.variants())}")
    if variant.startswith("llvm_"):
        _require_loaded(choice)
    if _active == variant == mi.variant():
        return variant
    _active = None
    mi.set_variant(variant)
    if not variant.startswith("scalar_"):
        _load_plugins()
    _active = variant
    return variant


def set_threads(threads: int) -> None:
    """Render with so many threads from now on (llvm variants); call `use` first."""
    import drjit

    drjit.set_thread_count(threads)


def active() -> str | None:
    """Return the variant that `use` made active, None before."""
    return _active


def cuda_driver() -> str | None:
    """Return the name or path of the NVIDIA driver library, None if this machine has none."""
    named = os.environ.get("DRJIT_LIBCUDA_PATH")
    if named and Path(named).is_file():
        return named
    on_windows_subsystem = Path("/usr/lib/wsl/lib/libcuda.so.1")
    return ctypes.util.find_library("cuda") or (str(on_windows_subsystem) if on_windows_subsystem.is_file() else None)


def _require_backend(variant: str, choice: llvm.Choice) -> None:
    if (variant.startswith("llvm_") and choice.path is None) or packages.missing_libraries():
        raise ValueError(f"variant {variant}: {llvm.problem(choice)}; type: {llvm.remedy(choice)}")
    if variant.startswith("cuda_") and cuda_driver() is None:
        raise ValueError(f"variant {variant}: no NVIDIA driver library (libcuda.so.1), allowed: {DEFAULT}")


def _require_loaded(choice: llvm.Choice) -> None:
    """Refuse a process in which another libLLVM was loaded before this module could choose."""
    loaded = llvm.loaded()
    if sys.platform == "linux" and choice.path.resolve() not in loaded:
        raise ValueError(
            f"libLLVM: got {', '.join(map(str, loaded)) or 'none'}, allowed: {choice.path}; "
            "where mitsuba was imported before uwsim.render.variants.use was called, call that first"
        )


def _import_mitsuba(*, quietly: bool) -> ModuleType:
    # where libLLVM is kept away from it, Dr.Jit complains on stderr while it is imported
    with no_stderr() if quietly and "drjit" not in sys.modules else contextlib.nullcontext():
        return importlib.import_module("mitsuba")


def _load_plugins() -> None:
    """Execute every plugin file: a plugin class inherits from the variant active while its file runs."""
    for info in pkgutil.walk_packages(plugins.__path__, f"{plugins.__name__}."):
        if info.ispkg:
            continue
        if info.name in sys.modules:
            importlib.reload(sys.modules[info.name])
        else:
            importlib.import_module(info.name)
