"""What several tests of poses share: errors of solutions, runs of `uwsim pose layout`."""

import sys

import numpy as np
import pytest

from uwsim import cli
from uwsim.metrics.pose import rotation_error_deg, translation_error_percent
from uwsim.pose import design

VIEW = design.View(np.array([[1300.0, 0, 653], [0, 1300, 508], [0, 0, 1]]), 1306, 1016, 0.3)
SIZE = ("--camera", "640x480", "--fov-deg", "60")


def errors(solution, placed):
    """Return rotation [deg] and translation [%] errors; infinite where there is no pose."""
    ok = solution.ok
    turned, moved = np.full(len(ok), np.inf), np.full(len(ok), np.inf)
    turned[ok] = rotation_error_deg(solution.rotation[ok], placed.rotation[ok])
    moved[ok] = translation_error_percent(solution.translation_m[ok], placed.translation_m[ok])
    return turned, moved


def run_layout(monkeypatch, *arguments):
    """Return the exit code of `uwsim pose layout ...`."""
    monkeypatch.setattr(sys, "argv", ["uwsim", "pose", "layout", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code
