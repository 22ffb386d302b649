"""`uwsim pose layout`: layouts by name and file, expected errors along the sweeps, files written, misuse refused."""

import csv
import json
import sys

import numpy as np
import pytest

from uwsim import cli
from uwsim.pose import bound, design, design_files, design_trials, problems
from uwsim.pose.layouts import NAMES, read_layout

VIEW = design.View(np.array([[1300.0, 0, 653], [0, 1300, 508], [0, 0, 1]]), 1306, 1016, 0.3)
SIZE = ("--camera", "640x480", "--fov-deg", "60")


def run(monkeypatch, *arguments):
    """Return the exit code of `uwsim pose layout ...`."""
    monkeypatch.setattr(sys, "argv", ["uwsim", "pose", "layout", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code


def all_curves(points_m, *, tilt_deg=30.0, distance_m=1.0, view=VIEW):
    found = design.sweeps(view, distance_m=distance_m, tilt_deg=tilt_deg)
    return {sweep.quantity: (sweep, design.curves(points_m, sweep, view)) for sweep in found}


def test_names_and_files_give_the_same_points(tmp_path):
    for name, short in NAMES.items():
        np.testing.assert_array_equal(read_layout(name), problems.layout(short, edge_m=0.1))
    np.testing.assert_array_equal(read_layout("square", edge_m=0.05), problems.layout("pl4", edge_m=0.05))
    points_m = read_layout("pyramid")
    rows = "\n".join(",".join(map(repr, row)) for row in points_m.tolist())
    (tmp_path / "plain.csv").write_text(rows)
    (tmp_path / "named.csv").write_text(f"x_m,y_m,z_m\n{rows}\n")
    (tmp_path / "points.toml").write_text(f"points_m = {points_m.tolist()}\n")
    for name in ("plain.csv", "named.csv", "points.toml"):
        np.testing.assert_array_equal(read_layout(str(tmp_path / name)), points_m)


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("a.csv", "0,0,0\n1,0,0\n0,1,0\n", "shape \\(3, 3\\)"),
        ("a.csv", "0,0,0\n1,0,0\n2,0,0\n3,0,0\n", "one line"),
        ("a.csv", "0,0,0\n1,0,0\n0,1,0\n0,1,0\n", "two points are the same"),
        ("a.csv", "0,0,0\n1,0\n0,1,0\n0,1,1\n", "point 2 has 2 numbers"),
        ("a.csv", "0,0,0\n1,0,zero\n0,1,0\n0,1,1\n", "no numbers"),
        ("a.csv", "0,0,0\n1,0,nan\n0,1,0\n0,1,1\n", "NaN"),
        ("a.csv", "", "shape"),
        ("a.toml", "points = [[0, 0, 0]]\n", "got keys points, allowed: points_m"),
        ("a.toml", "points_m = 3\n", "shape"),
        ("a.toml", "points_m = [[0, 0, 0], [1]]\n", "no numbers"),
        ("a.toml", "points_m = [\n", "not readable as TOML"),
    ],
)
def test_files_that_are_no_layout_are_refused(name, text, what, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=what) as error:
        read_layout(str(tmp_path / name))
    assert "\n" not in str(error.value)


def test_curves_are_the_bound_averaged_over_orientations():
    points_m = read_layout("octahedron")
    sweep, curves = all_curves(points_m)["distance_m"]
    place = 20
    assert sweep.values[place] == pytest.approx(1.0)
    turns = sweep.rotation[place]
    np.testing.assert_allclose(turns[:, 2, 2], np.cos(np.radians(30)), atol=1e-12)
    least = bound.bound(points_m, turns, np.tile([0, 0, 1.0], (len(turns), 1)), K=VIEW.K, noise_px=0.3)
    assert curves.rotation_bound_deg[place] == pytest.approx(np.sqrt(np.mean(least.rotation_deg**2)))
    assert curves.translation_bound_percent[place] == pytest.approx(np.sqrt(np.mean(least.translation_percent**2)))
    # far away the rotation's error goes by the distance; control: not by its square
    growth = curves.rotation_bound_deg[-1] / curves.rotation_bound_deg[-11]
    assert growth == pytest.approx(sweep.values[-1] / sweep.values[-11], rel=0.05)


def test_formulas_of_a_square_against_the_bound():
    """Corrected within a few percent of it at every tilt; as printed right at 0 alone, and elsewhere far too high."""
    sweep, curves = all_curves(read_layout("square"))["tilt_deg"]
    np.testing.assert_allclose(curves.rotation_plane_corrected_deg, curves.rotation_bound_deg, rtol=0.02)
    printed = curves.rotation_plane_printed_deg / curves.rotation_bound_deg
    assert printed[0] == pytest.approx(1, abs=0.01) and printed[-1] > 5
    assert curves.rotation_bound_deg.argmin() == len(sweep.values) - 1  # no least error at 54.7 deg
    assert curves.rotation_segments_deg[20] == pytest.approx(curves.rotation_bound_deg[20], rel=0.5)
    solid = all_curves(read_layout("octahedron"))["tilt_deg"][1]
    assert np.all(np.isnan(solid.rotation_plane_printed_deg)) and np.all(np.isfinite(solid.rotation_bound_deg))


def test_places_out_of_the_picture_have_no_error():
    points_m = read_layout("square", edge_m=0.4)
    sweep, curves = all_curves(points_m)["distance_m"]
    seen = design.in_picture(points_m, sweep, VIEW)
    assert 0 < seen.sum() < len(seen) and not seen[0] and seen[-1]
    np.testing.assert_array_equal(np.isfinite(curves.rotation_bound_deg), seen)
    _, aside = all_curves(points_m)["off_axis_m"]
    assert np.isfinite(aside.rotation_bound_deg[0]) and np.isnan(aside.rotation_bound_deg[-1])


def test_trials_reach_the_bound_of_a_solid_layout_and_tell_the_flips_of_a_flat_one():
    points_m = read_layout("octahedron", edge_m=0.2)
    sweep, curves = all_curves(points_m)["distance_m"]
    found = design_trials.tried(points_m, sweep, VIEW, trials=200, rng=np.random.default_rng(0), places=3)
    expected = np.interp(found.values, sweep.values, curves.rotation_bound_deg)
    np.testing.assert_allclose(found.rotation_deg / expected, 1, atol=0.12)
    expected = np.interp(found.values, sweep.values, curves.translation_bound_percent)
    np.testing.assert_allclose(found.translation_percent / expected, 1, atol=0.2)
    assert np.all(found.elsewhere_percent == 0)
    points_m = read_layout("square", edge_m=0.025)
    sweep, _ = all_curves(points_m)["distance_m"]
    flat = design_trials.tried(points_m, sweep, VIEW, trials=100, rng=np.random.default_rng(0), places=2)
    assert flat.elsewhere_percent[0] < 5 and flat.elsewhere_percent[1] > 15
    with pytest.raises(ValueError, match="trials: got 0"):
        design_trials.tried(points_m, sweep, VIEW, trials=0, rng=np.random.default_rng(0))


def test_the_command_writes_picture_and_numbers(tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    given = ("square", *SIZE, "--out", out, "--trials", 3, "--edge-m", 0.05, "--noise-px", 0.5)
    assert run(monkeypatch, *given) == 0
    assert "deg" in capsys.readouterr().out
    assert (out / "layout.png").read_bytes().startswith(b"\x89PNG")
    content = json.loads((out / "layout.json").read_text())
    assert content["noise_px"] == 0.5 and content["K_px"][0][0] == pytest.approx(320 / np.tan(np.pi / 6))
    assert set(content["sweeps"]) == {"distance_m", "off_axis_m", "tilt_deg"}
    tilt = content["sweeps"]["tilt_deg"]
    assert len(tilt["rotation_bound_deg"]) == len(tilt["tilt_deg"]) == design.STEPS
    with (out / "layout.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["sweep"] == "tilt_deg"]
    drawn = [float(row["error"]) for row in rows if row["curve"] == "rotation_bound_deg"]
    np.testing.assert_allclose(drawn, tilt["rotation_bound_deg"], rtol=1e-5)
    assert len([row for row in rows if row["curve"] == "best_rotation_deg"]) == design_trials.PLACES
    first = {name: (out / name).read_bytes() for name in ("layout.png", "layout.json", "layout.csv")}
    assert run(monkeypatch, *given) == 0
    assert first == {name: (out / name).read_bytes() for name in first}


def test_a_camera_file_is_the_camera_of_its_numbers(tmp_path):
    (tmp_path / "camera.toml").write_text("width_px = 1306\nheight_px = 1016\nK_px = [1301.5, 1300.9, 653, 508]\n")
    view = design_files.read_view(str(tmp_path / "camera.toml"), fov_deg=None, focal_px=None, noise_px=0.2)
    np.testing.assert_array_equal(view.K, [[1301.5, 0, 653], [0, 1300.9, 508], [0, 0, 1]])
    same = design_files.read_view("1306x1016", fov_deg=None, focal_px=1301.5, noise_px=0.2)
    assert same.K[0, 0] == same.K[1, 1] == 1301.5 and same.width_px == 1306
    (tmp_path / "camera.toml").write_text("width_px = 1306\nheight_px = 1016\nK_px = [1301.5, 1300.9, 653, 5080]\n")
    with pytest.raises(ValueError, match="within the picture"):
        design_files.read_view(str(tmp_path / "camera.toml"), fov_deg=None, focal_px=None, noise_px=0.2)
    with pytest.raises(ValueError, match="--fov-deg: got with the file"):
        design_files.read_view(str(tmp_path / "camera.toml"), fov_deg=50, focal_px=None, noise_px=0.2)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("hexagon", *SIZE), "got 'hexagon', allowed: octahedron"),
        (("none.csv", *SIZE), "none.csv: no such file"),
        (("none.toml", *SIZE, "--edge-m", "0.1"), "edge: got 0.1 m with the file"),
        (("square", *SIZE, "--edge-m", "0"), "edge: got 0.0 m"),
        (("square", *SIZE, "--edge-m", "nan"), "edge: got nan m"),
        (("square", "--camera", "640"), "--camera: got '640'"),
        (("square", "--camera", "none.toml"), "none.toml: no such file"),
        (("square", "--camera", "640x480"), "got neither, allowed: one of --fov-deg and --focal-px"),
        (("square", *SIZE, "--focal-px", "500"), "got --fov-deg, --focal-px"),
        (("square", "--camera", "640x480", "--fov-deg", "180"), "got 180"),
        (("square", "--camera", "640x480", "--fov-deg", "nan"), "horizontal_fov_deg: got nan"),
        (("square", "--camera", "640x480", "--focal-px", "inf"), "a finite number"),
        (("square", "--camera", "0x480", "--fov-deg", "60"), "width_px: got 0"),
        (("square", *SIZE, "--noise-px", "0"), "--noise-px: got 0.0"),
        (("square", *SIZE, "--distance-m", "-1"), "distance: got -1.0 m"),
        (("square", *SIZE, "--distance-m", "nan"), "distance: got nan m"),
        (("square", *SIZE, "--tilt-deg", "91"), "tilt: got 91.0 deg"),
        (("square", *SIZE, "--trials", "-1"), "trials"),
        (("square", *SIZE, "--distance-m", "0.01"), "nowhere whole in the picture"),
    ],
)
def test_misuse_is_one_line_and_exit_code_2(arguments, what, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *arguments, "--out", tmp_path / "out") == 2
    told = capsys.readouterr().err
    assert what in told and told.count("\n") == 1 and told.startswith("uwsim: ")
    assert not (tmp_path / "out").exists()


def test_output_folder_that_cannot_be_is_refused(tmp_path, monkeypatch, capsys):
    assert run(monkeypatch, "square", *SIZE, "--out", tmp_path / "no" / "out") == 2
    assert "does not exist" in capsys.readouterr().err
