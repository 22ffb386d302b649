"""System libraries that Dr.Jit needs beside its wheel, and the one command that installs them here."""

import ctypes
import os
import platform
import re
import shutil
import subprocess
import sys

MINIMUM_LLVM = 17
TESTED_LLVM = 19
LIBATOMIC = "libatomic.so.1"


def missing_libraries() -> list[str]:
    """Return the shared libraries that Dr.Jit is linked against and this system lacks (libLLVM apart).

    A minimal Debian has no libatomic; `import drjit` then fails with a message that does not name it.
    """
    if sys.platform != "linux":
        return []
    try:
        ctypes.CDLL(LIBATOMIC)
    except OSError:
        return [LIBATOMIC]
    return []


def install_command(*, llvm: bool, libatomic: bool) -> str:
    """Return the one command to type on this system for what is asked for (without sudo for root)."""
    root = os.geteuid() == 0
    sudo = "" if root else "sudo "
    conda = "conda install -y -c conda-forge " + _join(llvm and "libllvm19", libatomic and "libgcc")
    if os.environ.get("CONDA_PREFIX") and not root and not shutil.which("sudo"):
        return conda
    if shutil.which("apt-get"):
        return _apt_command(sudo, llvm=llvm, libatomic=libatomic) or conda
    for tool, arguments in (
        ("dnf", _join("install -y", llvm and "llvm-libs", libatomic and "libatomic")),
        ("zypper", _join("--non-interactive install", llvm and "libLLVM19", libatomic and "libatomic1")),
        ("pacman", _join("-S --noconfirm", llvm and "llvm-libs", libatomic and "gcc-libs")),
    ):
        if shutil.which(tool):
            return f"{sudo}{tool} {arguments}"
    return "brew install llvm" if shutil.which("brew") else conda


def _join(*words: str | bool) -> str:
    return " ".join(word for word in words if word)


def _apt_command(sudo: str, *, llvm: bool, libatomic: bool) -> str | None:
    """Return the apt command, None where this release has no usable libLLVM."""
    known = _apt_versions() if llvm else {}
    package = known[min(known, key=lambda major: (abs(major - TESTED_LLVM), major))] if known else None
    install = f"{sudo}apt-get install -y "
    if llvm and not package:
        package = _package_of_release()
        if package is None:
            return None
        # the release has it and apt does not know: a fresh machine without package lists
        install = f"{sudo}apt-get update && {install}"
    return install + _join(package or False, libatomic and "libatomic1")


def _apt_versions() -> dict[int, str]:
    """Return the libLLVM packages of a usable version that apt knows, by major version."""
    try:
        answer = subprocess.run(
            ["apt-cache", "search", "--names-only", "^libllvm[0-9]+(t64)?$"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
        )
    except OSError:
        return {}
    names = re.findall(r"^(libllvm(\d+)(?:t64)?) ", answer.stdout, re.MULTILINE)
    return {int(major): name for name, major in names if int(major) >= MINIMUM_LLVM}


def _package_of_release() -> str | None:
    try:
        release = platform.freedesktop_os_release()
        number = float(release.get("VERSION_ID", "0"))
    except (OSError, ValueError):
        return None
    if release.get("ID") == "debian" and number >= 12:
        return "libllvm19"
    return "libllvm18" if release.get("ID") == "ubuntu" and number >= 24 else None
