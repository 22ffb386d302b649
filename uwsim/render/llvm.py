"""Choose the libLLVM that Dr.Jit compiles with, before Dr.Jit is imported: importing it loads a libLLVM.

Dr.Jit takes the library named by DRJIT_LIBLLVM_PATH, else the first one that it finds. Versions below 17 lack
instructions that it needs and abort the whole process in mid-render: they are never offered to it.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from uwsim.render import packages

VARIABLE = "DRJIT_LIBLLVM_PATH"
MINIMUM = packages.MINIMUM_LLVM
# where the variable points while nothing usable exists: Dr.Jit then loads no libLLVM at all
BLOCKED = "/nonexistent/no-usable-libLLVM"

_NAME = re.compile(r"libLLVM(?:-(?P<dash>\d+(?:\.\d+)*))?\.(?:so|dylib)(?:\.(?P<dot>\d+(?:\.\d+)*))?")
_ASK = (
    "import ctypes, sys\n"
    "numbers = [ctypes.c_uint() for _ in range(3)]\n"
    "ctypes.CDLL(sys.argv[1]).LLVMGetVersion(*map(ctypes.byref, numbers))\n"
    "print(*(number.value for number in numbers), sep='.')\n"
)


@dataclass(frozen=True)
class Candidate:
    """A libLLVM on this machine: its real path and its version, such as "19.1"."""

    path: Path
    version: str


@dataclass(frozen=True)
class Choice:
    """The libLLVM to use; `path` and `version` are None where none is usable. `reason` is one line."""

    path: Path | None
    version: str | None
    reason: str


_prepared: Choice | None = None


def version_in_name(name: str) -> str | None:
    """Return the version that a file name states (libLLVM-17.so.1: 17, libLLVM.so.19.1: 19.1), or None."""
    match = _NAME.fullmatch(name)
    return (match["dash"] or match["dot"]) if match else None


def ask_version(path: Path) -> str | None:
    """Return the exact version ("19.1.7") of a library, loaded in a process of its own; None if it fails."""
    try:
        answer = subprocess.run(
            [sys.executable, "-I", "-c", _ASK, str(path)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=60,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    version = answer.stdout.strip()
    return version if answer.returncode == 0 and re.fullmatch(r"\d+\.\d+\.\d+", version) else None


def find(folders: Iterable[Path] | None = None) -> list[Candidate]:
    """Return every libLLVM of this machine (or of the given folders), newest first, each real file once."""
    cached = _linker_cache() if folders is None else []
    files = [*cached, *_libraries(_standard_folders() if folders is None else folders)]
    found = {}
    for path in files:
        real = path.resolve()
        if real not in found and real.is_file():
            found[real] = version_in_name(real.name) or ask_version(real)
    known = [Candidate(path, version) for path, version in found.items() if version]
    return sorted(known, key=lambda candidate: _numbers(candidate.version), reverse=True)


def choose(candidates: list[Candidate] | None = None) -> Choice:
    """Return the libLLVM to use: the one that DRJIT_LIBLLVM_PATH names, else the newest candidate.

    A named library that is missing or too old is refused with the reason; nothing else is taken in its place.
    """
    named = os.environ.get(VARIABLE, "")
    if named == BLOCKED:
        return Choice(None, None, "no usable libLLVM, as the process that started this one found")
    if named:
        return _judge_named(Path(named))
    candidates = find() if candidates is None else candidates
    usable = [candidate for candidate in candidates if _usable(candidate.version)]
    if usable:
        newest = max(usable, key=lambda candidate: _numbers(candidate.version))
        return Choice(newest.path, newest.version, f"the newest of {len(candidates)} found")
    others = ", ".join(candidate.version for candidate in candidates)
    too_old = f"; found {others}, which would abort the process" if others else ""
    return Choice(None, None, f"no libLLVM >= {MINIMUM} on this machine{too_old}")


def prepare() -> Choice:
    """Choose a libLLVM once per process and name it in DRJIT_LIBLLVM_PATH; call this before importing drjit.

    Where none is usable the variable names a file that does not exist, which keeps Dr.Jit from any other.
    """
    global _prepared
    if _prepared is None or os.environ.get(VARIABLE) != str(_prepared.path or BLOCKED):
        _prepared = choose()
        os.environ[VARIABLE] = str(_prepared.path or BLOCKED)
    return _prepared


def loaded() -> list[Path]:
    """Return the libLLVM files mapped into this process (always empty outside Linux)."""
    maps = Path("/proc/self/maps")
    if not maps.exists():
        return []
    paths = {line.split(maxsplit=5)[-1] for line in maps.read_text().splitlines() if "/libLLVM" in line}
    return sorted(map(Path, paths))


def problem(choice: Choice) -> str | None:
    """Return in one line what keeps Dr.Jit from compiling here, None if nothing does."""
    missing = packages.missing_libraries()
    if choice.path is not None and not missing:
        return None
    return "; ".join([*([] if choice.path else [choice.reason]), *(f"no {name}" for name in missing)])


def install_command() -> str:
    """Return the one command to type for a usable libLLVM on this system (without sudo for root)."""
    return packages.install_command(llvm=True, libatomic=bool(packages.missing_libraries()))


def remedy(choice: Choice) -> str:
    """Return the one command to type where `problem(choice)` is not None."""
    if choice.path is not None:
        return packages.install_command(llvm=False, libatomic=True)
    if choice.reason.startswith(VARIABLE) and any(_usable(candidate.version) for candidate in find()):
        return f"unset {VARIABLE}"
    return install_command()


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def _usable(version: str) -> bool:
    return _numbers(version)[0] >= MINIMUM


def _judge_named(path: Path) -> Choice:
    if not path.is_file():
        return Choice(None, None, f"{VARIABLE}: got {path}, which does not exist")
    version = version_in_name(path.resolve().name) or ask_version(path)
    if version is None:
        return Choice(None, None, f"{VARIABLE}: got {path}, which is not a libLLVM that loads")
    if not _usable(version):
        return Choice(None, None, f"{VARIABLE}: got {path}, LLVM {version}, allowed: {MINIMUM} or newer")
    return Choice(path, version, f"{VARIABLE} names it")


def _linker_cache() -> list[Path]:
    """Return the libraries of `ldconfig -p` that are of this machine's architecture."""
    tool = shutil.which("ldconfig", path=f"{os.environ.get('PATH', '')}:/sbin:/usr/sbin")
    if not tool:
        return []
    try:
        answer = subprocess.run([tool, "-p"], stdin=subprocess.DEVNULL, capture_output=True, text=True)
    except OSError:
        return []
    # 32-bit copies of the same version stand in the same list
    mark = {"x86_64": "x86-64", "aarch64": "AArch64"}.get(platform.machine(), "")
    lines = [line.partition(" => ") for line in answer.stdout.splitlines() if "libLLVM" in line]
    return [Path(path) for flags, _, path in lines if path and mark in flags]


def _standard_folders() -> list[Path]:
    multiarch = sysconfig.get_config_var("MULTIARCH") or f"{platform.machine()}-linux-gnu"
    folders = [Path("/usr/lib") / multiarch, *sorted(Path("/usr/lib").glob("llvm-*/lib"))]
    folders += [Path("/usr/lib64"), *sorted(Path("/usr/lib64").glob("llvm*/lib*")), Path("/usr/local/lib")]
    folders += [Path(prefix) / "lib" for prefix in (os.environ.get("CONDA_PREFIX"), sys.prefix) if prefix]
    if sys.platform == "darwin":
        for homebrew in (Path("/opt/homebrew/opt"), Path("/usr/local/opt")):
            folders += sorted(homebrew.glob("llvm*/lib"))
    return folders


def _libraries(folders: Iterable[Path]) -> list[Path]:
    files = [path for folder in folders for path in sorted(Path(folder).glob("libLLVM*"))]
    return [path for path in files if _NAME.fullmatch(path.name)]


def main(arguments: list[str]) -> int:
    """Print the choice and return 0, else print why not and return 1; `--remedy` prints the command alone."""
    choice = choose()
    if arguments == ["--remedy"]:
        print(remedy(choice))
        return 0
    if trouble := problem(choice):
        print(f"{trouble}; type: {remedy(choice)}")
        return 1
    print(f"libLLVM {choice.version}: {choice.path} ({choice.reason})")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
