"""`import uwsim` and the command line start without the heavy packages: help and errors come at once."""

import json
import subprocess
import sys

import pytest


def loaded_after(statement: str, packages: set[str]) -> set[str]:
    """Return those of the packages that a new process has loaded after one statement."""
    seen = f"[name for name in {sorted(packages)!r} if name in sys.modules]"
    code = f"{statement}\nimport json, sys\nprint(json.dumps({seen}))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert answer.returncode == 0, answer.stderr
    return set(json.loads(answer.stdout.splitlines()[-1]))


@pytest.mark.parametrize(
    ("statement", "heavy"),
    [
        ("import uwsim", {"mitsuba", "drjit", "cv2", "torch", "matplotlib", "numpy", "pydantic"}),
        ("import uwsim.cli", {"mitsuba", "drjit", "cv2", "torch", "matplotlib"}),
        ("import uwsim.provenance", {"mitsuba", "drjit", "cv2", "torch", "numpy"}),
        ("import uwsim.render.llvm", {"mitsuba", "drjit"}),
        ("import uwsim.render.variants, uwsim.render.doctor", {"mitsuba", "drjit"}),
        ("from uwsim.render import llvm; llvm.prepare()", {"mitsuba", "drjit"}),
        ("import uwsim.dataset", {"mitsuba", "drjit", "cv2", "torch", "matplotlib"}),
    ],
)
def test_heavy_packages_are_not_loaded(statement, heavy):
    assert loaded_after(statement, heavy) == set()


def test_a_loaded_package_is_seen():
    assert loaded_after("import numpy", {"numpy", "torch"}) == {"numpy"}
