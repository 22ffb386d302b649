"""Geometry buffers need no libLLVM; rendering says in one line that it does."""

import os
import subprocess
import sys

import numpy as np
import pytest

from uwsim.dataset import exr

NO_LLVM = os.environ | {"DRJIT_LIBLLVM_PATH": "/nonexistent/libLLVM.so.19.1"}


def uwsim(*arguments, **options):
    command = [sys.executable, "-c", "from uwsim.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


@pytest.mark.parametrize("scene", ["tank_colorchecker", "tank_markers"])
def test_the_same_buffers_with_and_without_libllvm(tmp_path, scene):
    arguments = ("render", scene, "--size", "32x24", "--geometry-only", "--out")
    assert uwsim(*arguments, tmp_path / "with").returncode == 0
    without = uwsim(*arguments, tmp_path / "without", env=NO_LLVM)
    assert without.returncode == 0, without.stderr
    first, second = (exr.read(tmp_path / name / "geometry.exr") for name in ("with", "without"))
    assert set(first) == {"range", "z_depth", "normal", "albedo", "instance"}
    for name, image in first.items():
        # two builds of the same ray caster: a ray along an edge may fall on either side
        same = np.isclose(image, second[name], rtol=1e-5, atol=1e-3)
        assert same.mean() > 0.995, name
    assert len(np.unique(first["instance"])) > 1


def test_rendering_without_libllvm_is_one_line(tmp_path):
    run = uwsim("render", "tank_markers", "--size", "32x24", "--out", tmp_path / "frame", env=NO_LLVM)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "DRJIT_LIBLLVM_PATH" in run.stderr
    assert not (tmp_path / "frame").exists()


def test_a_rendered_frame_is_sound(tmp_path):
    """The command writes the frame of the published format."""
    from uwsim.dataset.check import check_frame
    from uwsim.dataset.frame import read_frame

    out = tmp_path / "frame"
    run = uwsim("render", "tank_markers", "--size", "32x24", "--samples", "8", "--batches", "4", "--out", out)
    assert run.returncode == 0, run.stderr
    frame = read_frame(out)
    check_frame(frame)
    assert frame.image.shape == (24, 32, 3)
    assert frame.info.samples_per_pixel == 8
