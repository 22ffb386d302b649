"""`uwsim pose layout`: misuse is one line and exit code 2 with nothing written; every number has its limits."""

import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from pose_runs import SIZE, VIEW, run_layout

from uwsim import cli
from uwsim.pose import design, design_files
from uwsim.pose.layouts import read_layout


def refused(monkeypatch, capsys, *arguments, what):
    """Assert one line, exit code 2, no warning of NumPy's, and nothing written."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run_layout(monkeypatch, *arguments) == 2
    told = capsys.readouterr()
    assert what in told.err and told.err.count("\n") == 1 and told.err.startswith("uwsim: ") and told.out == ""
    assert not any(Path().iterdir())


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("hexagon", *SIZE), "got 'hexagon', allowed: octahedron"),
        (("none.csv", *SIZE), "none.csv: no such file"),
        (("none.toml", *SIZE, "--edge-m", "0.1"), "edge_m: got 0.1 m with the file"),
        (("square", *SIZE, "--edge-m", "1e-6", "--distance-m", "1e4"), "too small in the picture"),
        (("octahedron", *SIZE, "--edge-m", "1e-6", "--distance-m", "1e4", "--noise-px", "1e-6"), "too small in the"),
        (("square", "--camera", "640"), "--camera: got '640'"),
        (("square", "--camera", "none.toml"), "none.toml: no such file"),
        (("square", "--camera", "640x480"), "got neither, allowed: one of --fov-deg and --focal-px"),
        (("square", *SIZE, "--focal-px", "500"), "got --fov-deg, --focal-px"),
        (("square", "--camera", "0x480", "--fov-deg", "60"), "width_px: got 0"),
        (("square", *SIZE, "--distance-m", "0.01"), "nowhere whole in the picture"),
    ],
)
def test_misuse_is_one_line_and_exit_code_2(arguments, what, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    refused(monkeypatch, capsys, *arguments, "--out", "out", what=what)


NUMBERS = {
    "--fov-deg": ("0.1 to 170 deg", ("0", "0.09", "170.1")),
    "--focal-px": ("1 to 1e+07 px", ("0", "0.9", "1.1e7")),
    "--noise-px": ("1e-06 to 1000 px", ("0", "1001")),
    "--edge-m": ("1e-06 to 1000 m", ("0", "1001")),
    "--distance-m": ("0.001 to 10000 m", ("0", "10001")),
    "--tilt-deg": ("0 to 90 deg", ("-0.1", "90.1")),
    "--trials": ("a whole number, 0 to 10000", ("0.5", "10001", "100000000000", "1e3")),
    "--seed": ("a whole number, 0 to 9223372036854775807", ("0.5", "9223372036854775808", f"{10**60}")),
}


@pytest.mark.parametrize("option", list(NUMBERS))
def test_numbers_out_of_range_are_refused_by_the_name_of_their_option(option, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    allowed, more = NUMBERS[option]
    view = ("--camera=640x480",) + (() if option == "--focal-px" else ("--fov-deg=60",))
    least_denormal = () if option == "--tilt-deg" else ("1e-320",)
    for value in ("nan", "inf", "-inf", "-1", "1e300", "", " ", "text", "1_0", *least_denormal, *more):
        got = f"'{option}': got {value[:37]!r}"[:-1]
        what = f"allowed: {allowed} "
        refused(monkeypatch, capsys, "square", *view, "--out=out", f"{option}={value}", what=what)
        assert run_layout(monkeypatch, "square", *view, "--out=out", f"{option}={value}") == 2
        assert got in capsys.readouterr().err


def test_numbers_at_the_ends_of_their_ranges_give_results_without_a_warning(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given = [
        ("--tilt-deg=1e-320", "--seed=9223372036854775807"),
        ("--tilt-deg=90", "--noise-px=1000"),
        ("--noise-px=1e-6", "--edge-m=1e-6", "--distance-m=0.001"),
        ("--edge-m=1000", "--distance-m=10000", "--noise-px=1000"),
    ]
    for index, options in enumerate(given):
        if index:  # one picture is enough: the others differ in their numbers
            monkeypatch.setattr(design_files, "plot_design", lambda *_, **__: None)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert run_layout(monkeypatch, "square", *SIZE, "--out=out", "--trials=1", *options) == 0
        assert capsys.readouterr().err == ""


def test_the_library_has_the_same_limits(tmp_path):
    with pytest.raises(ValueError, match="edge_m: got 1e-320 m, allowed: 1e-06 to 1000 m"):
        read_layout("square", edge_m=1e-320)
    with pytest.raises(ValueError, match="noise_px: got 1e\\+300 px, allowed: 1e-06 to 1000 px"):
        design_files.read_view("640x480", fov_deg=60, focal_px=None, noise_px=1e300)
    with pytest.raises(ValueError, match="horizontal_fov_deg: got 171, allowed: <= 170"):
        design_files.read_view("640x480", fov_deg=171, focal_px=None, noise_px=1)
    with pytest.raises(ValueError, match="distance_m: got 1e\\+308 m, allowed: 0.001 to 10000 m"):
        design.sweeps(VIEW, distance_m=1e308, tilt_deg=30)
    with pytest.raises(ValueError, match="tilt_deg: got nan deg, allowed: 0 to 90 deg"):
        design.sweeps(VIEW, distance_m=1, tilt_deg=np.nan)
    given = {"distance_m": 1.0, "tilt_deg": 30.0}
    for wrong in ({"trials": 10**11, "seed": 0}, {"trials": 1, "seed": -1}):
        with pytest.raises(
            ValueError, match="trials: got 100000000000, allowed: 0 to 10000|seed: got -1, allowed: 0 to"
        ):
            design_files.write_design("square", read_layout("square"), VIEW, tmp_path / "out", **given, **wrong)
    assert not (tmp_path / "out").exists()


def test_a_bare_group_is_one_line_and_its_help(monkeypatch, capsys):
    for arguments, known in ((["uwsim", "pose"], "layout"), (["uwsim"], "bench")):
        monkeypatch.setattr(sys, "argv", arguments)
        with pytest.raises(SystemExit) as stop:
            cli.main()
        told = capsys.readouterr()
        assert stop.value.code == 2 and told.err.count("\n") == 1
        assert told.err.startswith(f"uwsim: no command after `{' '.join(arguments)}`, allowed: ") and known in told.err
        assert "Usage" in told.out


def test_output_folder_that_cannot_be_is_refused(tmp_path, monkeypatch, capsys):
    assert run_layout(monkeypatch, "square", *SIZE, "--out", tmp_path / "no" / "out") == 2
    assert "does not exist" in capsys.readouterr().err
    monkeypatch.chdir(tmp_path)
    for name in ("", " "):
        refused(
            monkeypatch, capsys, "square", *SIZE, f"--out={name}", what=f"--out: got {name!r}, allowed: the name of a"
        )


@pytest.mark.parametrize("name", ["layout.png", "layout.json", "layout.csv"])
def test_no_file_is_written_where_another_cannot_be(name, tmp_path, monkeypatch, capsys):
    (tmp_path / name).mkdir()
    assert run_layout(monkeypatch, "square", *SIZE, "--out", tmp_path, "--trials", 0) == 2
    told = capsys.readouterr().err
    assert f"{name}: is a folder, allowed: a file" in told and told.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_nothing_is_written_where_the_picture_fails(tmp_path, monkeypatch, capsys):
    def fails(*_, **__):
        raise ValueError("no picture")

    monkeypatch.setattr(design_files, "plot_design", fails)
    monkeypatch.chdir(tmp_path)
    refused(monkeypatch, capsys, "square", *SIZE, "--out=out", "--trials=0", what="no picture")
