"""What made a result: package versions, the source tree's commit, the processor features that matter."""

import importlib.metadata
import os
import platform
import re
import subprocess
from pathlib import Path

from uwsim import __version__

ROOT = Path(__file__).parent.parent

# packages whose version can change the bytes of an image or a number in a table
PACKAGES = (
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "colour-science",
    "OpenEXR",
    "scikit-image",
    "opencv-python-headless",
    "pydantic",
)
OPTIONAL_PACKAGES = ("torch", "pyoidn", "poselib", "PythonicDISORT", "iadpython")

# processor features that decide the vector width or how multiplications and additions are fused
FEATURES = (
    "sse4_2",
    "avx",
    "avx2",
    "fma",
    "f16c",
    "avx512f",
    "avx512dq",
    "avx512bw",
    "avx512vl",
    "asimd",
    "sve",
)


def installed(package: str) -> str | None:
    """Return the version of an installed package by its name on the package index, None if it is missing."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def requirements(packages: list[str]) -> list[str]:
    """Return the packages with the version ranges that uwsim asks for, such as "mitsuba<3.10,>=3.9"."""
    try:
        stated = importlib.metadata.requires("uwsim") or []
    except importlib.metadata.PackageNotFoundError:
        stated = []
    ranges = {re.match(r"[\w.-]+", line)[0].lower(): line.partition(";")[0].strip() for line in stated}
    return [ranges.get(package.lower(), package) for package in packages]


def versions() -> dict[str, str]:
    """Return the versions of uwsim, Python and every installed package that can change a result."""
    found = {name: installed(name) for name in (*PACKAGES, *OPTIONAL_PACKAGES)}
    known = {name: version for name, version in found.items() if version}
    return {"uwsim": __version__, "python": platform.python_version(), **known}


def commit() -> str | None:
    """Return the git commit of the source tree, with "-dirty" if it was modified.

    None where the package does not lie at the top of a git checkout, or git is missing.
    """
    top = _git("rev-parse", "--show-toplevel")
    head = _git("rev-parse", "HEAD")
    if not top or not head or Path(top).resolve() != ROOT.resolve():
        return None
    # untracked files count: a file in the right folder is part of the program
    modified = _git("status", "--porcelain", "--", "uwsim", "scenes", "benchmarks", "pyproject.toml")
    return f"{head}-dirty" if modified else head


def machine(*, libllvm: Path | None = None, llvm_version: str | None = None) -> dict:
    """Return what the bytes of a render depend on beside versions: processor features, vector width, libLLVM.

    The libLLVM in use is handed in; only the name of its file is kept. Valid: Linux; elsewhere no features.
    """
    features = cpu_features()
    return {
        "system": platform.system(),
        "architecture": platform.machine(),
        "cpu": cpu_name(),
        "cpu_features": features,
        "vector_width": vector_width(features),
        "libllvm": {"version": llvm_version, "file": Path(libllvm).name} if libllvm else None,
    }


def cpu_name() -> str | None:
    """Return the processor's model name, None where it is not known."""
    return _cpuinfo("model name")


def cpu_features() -> list[str]:
    """Return those of FEATURES that this processor has, in that order."""
    have = (_cpuinfo("flags") or _cpuinfo("Features") or "").split()
    return [name for name in FEATURES if name in have]


def vector_width(features: list[str]) -> int:
    """Return how many floats Dr.Jit's LLVM backend works on at once (16, 8 or 4)."""
    if "avx512vl" in features:
        return 16
    return 8 if "avx" in features else 4


def thread_count() -> int:
    """Return the number of threads this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _cpuinfo(key: str) -> str | None:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    match = re.search(rf"^{key}[ \t]*:[ \t]*(.*)$", text, re.MULTILINE)
    return match[1].strip() if match else None


def _git(*arguments: str) -> str | None:
    try:
        answer = subprocess.run(
            ["git", "--no-optional-locks", "-C", str(ROOT), *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
        )
    except OSError:
        return None
    return answer.stdout.strip() if answer.returncode == 0 else None
