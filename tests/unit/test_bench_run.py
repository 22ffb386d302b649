"""The three benchmarks on a small synthetic dataset: known truth, known scores, users' own files."""

import json
import math

import numpy as np
import pytest
import synthetic

from uwsim.bench import blur, markers, pose, restoration
from uwsim.bench.definition import read_definition
from uwsim.bench.records import markdown, read_result
from uwsim.bench.run import load, run, select
from uwsim.bench.task import spread
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import lens_from_record, port_record
from uwsim.camera.sensor import expose_without_noise


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


def user_file(folder, code: str, name: str = "mine.py") -> str:
    path = folder / name
    path.write_text(code)
    return str(path)


def values(result, metric: str, case: str = "all") -> dict:
    return {r.algorithm: r.value for r in result.records if r.metric == metric and r.case == case}


def test_restoration_scores_the_still_frames_against_the_water_free_twin(dataset):
    result = run("restoration", dataset)
    assert {record.case for record in result.records} == {"000000", "000001", "000003", "all"}
    psnr = values(result, "psnr")
    assert list(psnr)[0] == "none"
    assert psnr["oracle_inverse"] > psnr["none"] + 5  # noise is all that is left
    frame = dataset.frame("000000")
    sensor = {key: value for key, value in synthetic.SENSOR.items() if key != "read_noise_e"}
    twin = expose_without_noise(frame.buffer("water_free"), **sensor)
    mse = np.mean((twin.astype(float) - frame.image) ** 2)
    assert values(result, "mse", "000000")["none"] == pytest.approx(mse, rel=1e-12)


def test_one_record_per_case_algorithm_and_metric(dataset):
    result = run("restoration", dataset)
    keys = [(record.case, record.algorithm, record.metric) for record in result.records]
    assert len(keys) == len(set(keys))
    assert len(keys) == len({k[0] for k in keys}) * len({k[1] for k in keys}) * len({k[2] for k in keys})
    given = {record.algorithm: record.given for record in result.records}
    assert given["none"] == ()
    assert given["oracle_inverse"] == ("backscatter", "transmission")


def test_the_median_over_cases_is_the_summary(dataset):
    result = run("restoration", dataset)
    cases = [values(result, "ssim", case)["none"] for case in ("000000", "000001", "000003")]
    assert values(result, "ssim")["none"] == pytest.approx(np.median(cases), rel=1e-15)


def test_inputs_say_what_the_docstring_says(dataset):
    case = restoration.case(dataset, "000000")
    inputs = {name: make() for name, make in case.makers.items()}
    assert set(inputs) == set(restoration.TASK.inputs)
    assert inputs["range_m"].shape == (96, 128)
    assert inputs["water"]["attenuation_per_m"] == pytest.approx(synthetic.ATTENUATIONS_PER_M[0])
    # the lamp hangs 0.3 m to the left of the camera and shines forward
    assert inputs["lamps"][0]["position_m"] == pytest.approx([-0.3, 0, 0], abs=1e-12)
    assert inputs["lamps"][0]["direction"] == pytest.approx([0, 0, 1], abs=1e-12)
    radiance = dataset.frame("000000").buffer("backscatter")
    assert inputs["backscatter"] == pytest.approx(radiance * inputs["camera"]["linear_per_radiance"], rel=1e-6)


def test_blur_scores_the_moving_frame_and_splits_off_uniform_motion(dataset):
    result = run("blur", dataset)
    assert {record.case for record in result.records} == {"000002", "all", "uniform"}
    length = values(result, "length_error_px")
    assert length["none"] == pytest.approx(synthetic.BLUR_LENGTH_PX)
    assert length["oracle_sharp"] < 0.5
    assert values(result, "angle_error_deg", "uniform")["oracle_sharp"] < 2
    assert values(result, "failure_percent")["none"] == 100
    assert values(result, "failure_percent")["oracle_sharp"] == 0


def test_pose_is_scored_against_the_scene(dataset):
    result = run("pose", dataset)
    rotation = values(result, "rotation_error_deg")
    assert rotation["frontal"] == pytest.approx(20, abs=1e-6)  # the board is tilted by 20 deg
    assert rotation["opencv_sqpnp"] < 1
    assert rotation["oracle_corners"] < 1e-6
    detected = values(result, "detected_percent")
    assert detected.pop("dlt") == 0  # the board is flat
    assert detected.pop("poselib") in (None, 100)  # an optional package
    assert set(detected.values()) == {100}
    assert values(result, "corner_error_px")["oracle_corners"] == 0
    assert 0 < values(result, "corner_error_px")["opencv_sqpnp"] < 0.5


def test_a_frame_without_detection_counts_and_has_no_error(dataset, monkeypatch):
    monkeypatch.setattr(markers, "detect_markers", lambda image, dictionary: {})
    result = run("pose", dataset)
    assert values(result, "detected_percent")["opencv_sqpnp"] == 0
    assert values(result, "rotation_error_deg")["opencv_sqpnp"] is None
    assert values(result, "detected_percent")["oracle_corners"] == 100
    json.dumps(result.to_dict(), allow_nan=False)


def test_provenance_names_definition_dataset_and_versions(dataset):
    provenance = run("pose", dataset, quick=True).provenance
    assert provenance["definition"]["do_nothing"] == "frontal"
    assert provenance["dataset"]["name"] == "synthetic"
    assert provenance["dataset"]["seed"] == 7
    assert len(provenance["dataset"]["sha256"]) == 64
    assert provenance["quick"] is True
    assert "numpy" in provenance["versions"]


def test_quick_takes_cases_from_the_whole_dataset(dataset, tmp_path):
    path = tmp_path / "few.toml"
    path.write_text(
        'task = "restoration"\ndescription = "x"\ndataset = "x"\nalgorithms = ["none"]\ndo_nothing = "none"\n'
        "quick_cases = 2\n"
    )
    result = run(str(path), dataset, quick=True)
    assert {record.case for record in result.records} == {"000000", "000003", "all"}
    assert spread(list("abcdef"), 3) in (["a", "c", "f"], ["a", "d", "f"])
    assert spread(["a"], 3) == ["a"]


def test_names_choose_and_paths_add():
    definition = read_definition("restoration")[1]
    chosen = select(restoration.TASK, definition, ["clahe", "x/mine.py"])
    assert chosen == ["none", "clahe", "oracle_wiener", "x/mine.py"]
    with pytest.raises(ValueError, match="'nothing', allowed: .*clahe"):
        select(restoration.TASK, definition, ["nothing"])
    with pytest.raises(ValueError, match="'clahe' takes part already"):
        select(restoration.TASK, definition, ["x/clahe.py"])


def test_a_users_file_takes_part_under_its_own_name(dataset, tmp_path):
    code = "NEEDS = ('water',)\ndef restore(image, *, water):\n    return 255 - image\n"
    result = run("restoration", dataset, algorithms=[user_file(tmp_path, code)], quick=True)
    assert list(values(result, "psnr"))[-1] == "mine"
    assert "| mine | water |" in markdown(result)
    assert str(tmp_path) not in result.to_json()


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("def restore(image, *, backscatter):\n    return image", "TypeError.*backscatter"),
        (
            "NEEDS = ('water_free',)\ndef restore(image, **k):\n    return image",
            "NEEDS has water_free, allowed",
        ),
        (
            "NEEDS = ('range_m',)\ndef restore(image, *, range_m, water):\n    return image",
            "TypeError.*water",
        ),
        ("def restore(image):\n    return image / 0", "mine: case 000000"),
        ("def restore(image):\n    return image / 255", "float64.*allowed"),
        ("def restore(image):\n    return image[::2]", "allowed"),
        ("def enhance(image):\n    return image", r"no function restore\(\)"),
        ("def restore(image):\n    image[:] = 0\n    return image", "modified"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_a_file_that_cheats_or_breaks_the_contract_stops_the_run(dataset, tmp_path, code, message):
    with pytest.raises(ValueError, match=message) as caught:
        run("restoration", dataset, algorithms=[user_file(tmp_path, code)], quick=True)
    assert "\n" not in str(caught.value)
    assert "mine" in str(caught.value)


def test_nothing_but_the_listed_inputs_can_be_reached_from_the_arguments(dataset, tmp_path):
    code = """
import numpy as np
NEEDS = ("range_m", "water", "lamps", "camera")
def restore(image, **inputs):
    assert set(inputs) == set(NEEDS), sorted(inputs)
    arrays = [image, inputs["range_m"], *inputs["water"].values(), inputs["camera"]["K"]]
    arrays += [value for lamp in inputs["lamps"] for value in lamp.values() if isinstance(value, np.ndarray)]
    assert all(array.base is None for array in arrays)
    inputs["range_m"][:] = 0  # its own copy: nobody else sees it
    return image.copy()
"""
    files = [user_file(tmp_path, code), user_file(tmp_path, code, "second.py")]
    result = run("restoration", dataset, algorithms=files, quick=True)
    psnr = values(result, "psnr")
    assert psnr["mine"] == psnr["second"] == psnr["none"]
    assert math.isfinite(values(run("restoration", dataset, quick=True), "psnr")["oracle_inverse"])


def test_identical_images_are_null_and_say_so(dataset, monkeypatch):
    monkeypatch.setattr(restoration, "reference", lambda frame: frame.image)
    result = run("restoration", dataset, quick=True)
    assert values(result, "psnr")["none"] is None
    notes = {record.note for record in result.records if (record.algorithm, record.metric) == ("none", "psnr")}
    assert notes == {"identical images"}


def test_a_method_whose_package_is_missing_stands_in_the_table(dataset, tmp_path):
    code = "REQUIRES = ('no_such_package_here',)\ndef restore(image):\n    import no_such_package_here\n"
    result = run("restoration", dataset, algorithms=[user_file(tmp_path, code)], quick=True)
    assert values(result, "psnr")["mine"] is None
    assert "not installed: no_such_package_here" in markdown(result)
    assert "mine" not in values(result, "psnr", "000000")


def test_progress_is_reported_per_case(dataset):
    seen = []
    run("restoration", dataset, progress=lambda text, done, total: seen.append((done, total)))
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3)]


@pytest.mark.parametrize(
    ("name", "frames", "message"),
    [
        ("restoration", (2,), "frame without motion blur"),
        ("blur", (0, 3), "frame in motion"),
        ("pose", (0, 2), "visible marker"),
    ],
)
def test_a_dataset_without_usable_frames_is_refused(tmp_path, name, frames, message):
    small = synthetic.write_dataset(tmp_path / "small", frames)
    with pytest.raises(ValueError, match=message):
        run(name, small)


def test_an_estimate_that_is_no_number_is_a_failure(dataset, tmp_path):
    code = """
from types import SimpleNamespace
def estimate(image):
    return SimpleNamespace(length_px=float("nan"), angle_deg=float("nan"))
"""
    result = run("blur", dataset, algorithms=[user_file(tmp_path, code)])
    assert values(result, "failure_percent")["mine"] == 100
    assert values(result, "length_error_px")["mine"] is None


def test_what_is_no_estimate_or_solution_is_refused(dataset, tmp_path):
    with pytest.raises(ValueError, match="blur: mine: case 000002.*Estimate"):
        run("blur", dataset, algorithms=[user_file(tmp_path, "def estimate(image):\n    return 3\n")])
    with pytest.raises(ValueError, match="pose: mine: case 000003.*Solution"):
        run("pose", dataset, algorithms=[user_file(tmp_path, "def solve(points_m, points):\n    return 3\n")])


def test_a_solver_gets_normalised_points_and_only_the_oracle_the_true_ones(dataset, tmp_path):
    case = pose.case(dataset, "000003")
    view = case.truth
    expected = np.column_stack([view.detected.image_px, np.ones(8)]) @ np.linalg.inv(synthetic.K).T
    code = """
import numpy as np
from uwsim.pose.solvers import opencv_sqpnp
seen = []
def solve(points_m, points, **inputs):
    seen.append((points_m, points, inputs))
    return opencv_sqpnp.solve(points_m, points)
"""
    algorithm = load(pose.TASK, user_file(tmp_path, code))
    found, _ = pose.solved(algorithm.module, "mine", algorithm.given, case)
    points_m, points, inputs = algorithm.module.seen[0]
    assert inputs == {}
    assert points_m.shape == (1, 8, 3)
    assert points[0] == pytest.approx(expected[:, :2], abs=1e-12)
    assert found[:3, 3] == pytest.approx(synthetic.camera_from_board()[:3, 3], abs=0.01)


def behind_a_port(folder):
    """Return the dataset's frame with markers, its camera behind a flat port and the true corners where it sees them.

    The picture is that of the pinhole: detection is to be put in its place.
    """
    made = synthetic.write_dataset(folder, frames=(3,))
    path = made.folder / "frames" / "000003" / "frame.json"
    info = json.loads(path.read_text())
    info["camera"]["port"] = port_record(FlatPort(gap_m=0.03, thickness_m=0.01, n_glass=1.52, n_water=1.334))
    lens = lens_from_record(info["camera"])
    camera_from_board = synthetic.camera_from_board()
    for marker in info["markers"]:
        corners_m = np.array(marker["corners_body_m"]) @ camera_from_board[:3, :3].T + camera_from_board[:3, 3]
        marker["corners_px"] = lens.project(corners_m)[0].tolist()
    path.write_text(json.dumps(info))
    return made, {marker["id"]: np.array(marker["corners_px"]) for marker in info["markers"]}


def test_behind_a_port_plain_solvers_get_a_pinhole_and_the_result_says_so(tmp_path, monkeypatch):
    """Expected: with the lens the pose is exact, without it is off by about what the port does to a pinhole, not by the
    third that the focal length in air would make. Control: a frame without a port has no such note."""
    made, corners = behind_a_port(tmp_path / "port")
    monkeypatch.setattr(markers, "detect_markers", lambda image, dictionary: corners)
    code = """
import numpy as np
from uwsim.pose.refine import refine
from uwsim.pose.solvers import opencv_sqpnp
NEEDS = ("lens", "pixels")
def solve(points_m, points, *, lens, pixels):
    return refine(opencv_sqpnp.solve(points_m, points), points_m, pixels, lens=lens)
"""
    result = run("pose", made, algorithms=["opencv_sqpnp", user_file(tmp_path, code, "with_lens.py")])
    error = values(result, "translation_error_percent")
    assert error["oracle_corners"] < 1e-6
    assert error["with_lens"] < 1e-6
    assert 0.1 < error["opencv_sqpnp"] < 5
    (note,) = result.provenance["cameras"]
    assert "flat port" in note and "160.1 px (in air 120.0 px)" in note and "000003" in note
    assert note in markdown(result)
    assert read_result_again(result, tmp_path).provenance["cameras"] == [note]
    plain = synthetic.write_dataset(tmp_path / "plain", frames=(3,))
    assert run("pose", plain).provenance["cameras"] == []


def read_result_again(result, folder):
    result.write(folder / "result.json")
    return read_result(folder / "result.json")


def test_behind_a_port_image_methods_get_radiance_in_the_water(tmp_path, dataset):
    """Expected: linear_per_radiance takes in the port's transmittance and (n_air / n_water)^2, about 0.95 / 1.334^2."""
    made, _ = behind_a_port(tmp_path / "port")
    camera, plain = (restoration.case(one, "000003").makers["camera"]() for one in (made, dataset))
    assert camera["linear_per_radiance"].shape == (synthetic.HEIGHT_PX, synthetic.WIDTH_PX, 3)
    share = camera["linear_per_radiance"][48, 64] / plain["linear_per_radiance"]
    assert share == pytest.approx(np.full(3, 0.95 / 1.334**2), rel=0.02)
    assert camera["K"][0, 0] == pytest.approx(1.334 * plain["K"][0, 0])


def test_motion_truth_is_the_frames_own(dataset):
    assert blur.summaries(dataset, ["000002"]) == {"all": ["000002"], "uniform": ["000002"]}
