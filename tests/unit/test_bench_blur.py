"""Blur of rendered frames: field against flow of every pixel, bound, strata; deconvolution of frames made here."""

import math

import numpy as np
import pytest
import synthetic

from uwsim.bench import blur, blur_deconvolution, blur_undone
from uwsim.bench.blur import estimates, field, strata
from uwsim.bench.blur.estimates import Refusal
from uwsim.bench.records import markdown
from uwsim.bench.run import run
from uwsim.metrics.image import psnr
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.estimators import whittle

FRAME = "000002"
ANGLE = math.radians(synthetic.BLUR_ANGLE_DEG)
RIGHT, UP = synthetic.BLUR_LENGTH_PX * math.cos(ANGLE), synthetic.BLUR_LENGTH_PX * math.sin(ANGLE)
CODE = """
import numpy as np
from uwsim.motion_blur.estimate import Estimate
INPUT = "linear_float32"
def estimate(image):
    return Estimate(3.0, 0.0)
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


@pytest.fixture(scope="module")
def case(dataset):
    return blur.case(dataset, FRAME)


def user_file(folder, code: str, name: str = "mine.py") -> str:
    (folder / name).write_text(CODE + code)
    return str(folder / name)


def values(result, metric: str, case: str = FRAME) -> dict:
    return {r.algorithm: r.value for r in result.records if r.metric == metric and r.case == case}


def tiles(displacement, verdict: str = "blur") -> str:
    return (
        "def field(image):\n    return {'centres_px': np.array([[20.0, 20.0], [90.0, 70.0]]), "
        f"'displacement_px': np.array([{list(displacement)}] * 2), 'verdict': np.array(['{verdict}'] * 2)}}\n"
    )


def test_truth_of_a_pixel_is_its_flow_with_y_up(case):
    assert case.truth.displacement_px[10, 10] == pytest.approx([RIGHT, UP], abs=0.01)
    assert case.truth.seen.all()


def test_the_made_blur_has_its_length():
    """Setup: a point, smeared. Expected: the variance of a line along the motion, length^2 / 12.

    Tolerance 1 %: linear interpolation adds a sixth of a square pixel (1 / 6 on both axes), in the mean over places
    between pixels. A blur an eighth of a pixel too long, as with both end points among 65 places, is off by 3 %.
    """
    point = np.zeros((synthetic.HEIGHT_PX, synthetic.WIDTH_PX))
    point[48, 64] = 1.0
    weights = synthetic.smear(point)
    row, column = np.indices(weights.shape)
    along = (column - 64) * math.cos(ANGLE) - (row - 48) * math.sin(ANGLE)
    assert weights.sum() == pytest.approx(1, abs=1e-3)
    variance = np.average(along**2, weights=weights) - np.average(along, weights=weights) ** 2
    assert variance - 1 / 6 == pytest.approx(synthetic.BLUR_LENGTH_PX**2 / 12, rel=0.01)


def test_the_field_of_an_estimator_is_held_against_every_pixel(dataset, tmp_path):
    """Expected: no error for the true field, of either sign. Control: y down instead of up is off by twice the rise."""
    files = {
        "right": tiles((RIGHT, UP)), "backwards": tiles((-RIGHT, -UP)), "down": tiles((RIGHT, -UP)),
        "none_seen": tiles((RIGHT, UP), "no blur"), "unsure": tiles((math.nan, UP)).replace("nan", "np.nan"), "one": "",
    }  # fmt: skip
    paths = [user_file(tmp_path, code, f"{name}.py") for name, code in files.items()]
    result = run("blur", dataset, algorithms=["none", *paths])
    found = values(result, "field_error_px")
    assert found["right"] == pytest.approx(0, abs=0.01)
    assert found["backwards"] == pytest.approx(0, abs=0.01)
    assert found["down"] == pytest.approx(min(2 * UP, 2 * RIGHT), abs=0.01)
    assert found["none"] == found["none_seen"] == pytest.approx(synthetic.BLUR_LENGTH_PX, abs=0.01)
    assert found["one"] == pytest.approx(math.hypot(RIGHT - 3, UP), abs=0.01)  # the single estimate stands for all
    assert found["unsure"] is None
    assert values(result, "field_answered_percent")["unsure"] == 0
    assert values(result, "field_answered_percent")["one"] == 100
    assert found["oracle_sharp"] < 0.5


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("def field(image):\n    return 3\n", "got 3, allowed: centres_px"),
        ("def field(image):\n    return {'centres_px': np.ones((2, 2))}\n", "allowed: centres_px"),
        (tiles((1.0, 1.0)).replace("'] * 2)", "'] * 3)"), r"got \(2, 2, 3\) centres"),
        ("def field(image):\n    return 1 / 0\n", "ZeroDivisionError"),
    ],
)
def test_what_is_no_field_stops_the_run_in_one_line(dataset, tmp_path, code, message):
    with pytest.raises(ValueError, match=message) as caught:
        run("blur", dataset, algorithms=["none", user_file(tmp_path, code)])
    assert "\n" not in str(caught.value)
    assert "mine: field of case 000002" in str(caught.value)


def test_each_pixel_has_the_answer_of_the_nearest_tile():
    output = {
        "centres_px": [[10.0, 10.0], [30.0, 10.0]], "displacement_px": [[1.0, 0.0], [5.0, 0.0]],
        "verdict": ["blur", "blur"],
    }  # fmt: skip
    found = field.spread_out(output, (20, 40), where="here")
    assert np.array_equal(found[..., 0], np.tile(np.repeat([1.0, 5.0], 20), (20, 1)))


def test_the_bound_of_a_frame_is_that_of_its_noise(case, dataset):
    """Frames of 128 x 96: worse than of 256 x 256, better than nothing. Control: four times the noise."""
    lengths, angles = case.truth.bound_sd
    assert 0.001 < lengths < 0.5
    assert 0.01 < angles < 5
    from uwsim.motion_blur.bound import bound

    sharp = case.makers["sharp"]()
    noisier = bound(sharp, noise_std=0.04, length_px=8.0, angle_deg=30.0)
    assert math.sqrt(noisier[0, 0]) > 1.5 * lengths


def test_conditions_and_strata(dataset):
    found = strata.conditions(dataset, [FRAME])[FRAME]
    assert found["group"] == found["water"] == "synthetic"
    assert found["motion"] == "straight"
    assert found["speed_percent"] is None
    frame = dataset.frame(FRAME)
    veil = frame.buffer("backscatter").sum() / frame.buffer("radiance").sum()
    assert found["veil_percent"] == pytest.approx(100 * veil, rel=1e-3)
    assert list(strata.strata({FRAME: found})) == [
        "group: synthetic", "water: synthetic", "length: 5 to 10 px",
        f"veil: {strata.band(found['veil_percent'], (10.0, 50.0), '% of the light')}", "uniform: yes",
    ]  # fmt: skip


def test_strata_go_up_and_the_arms_speeds_are_apart():
    base = {"group": "arm", "water": "tank_low", "veil_percent": 60.0, "uniform": False}
    found = {
        str(speed): base | {"length_px": 0.1 * speed, "motion": "arm_linear", "speed_percent": speed}
        for speed in (100.0, 20.0, 60.0)
    }  # fmt: skip
    found["x"] = base | {"length_px": 25.0, "motion": "straight", "speed_percent": None}
    groups = strata.strata(found)
    assert [name for name in groups if name.startswith("length")] == [
        "length: 2 to 5 px", "length: 5 to 10 px", "length: 10 to 20 px", "length: 20 px and more"
    ]  # fmt: skip
    speeds = {name: cases for name, cases in groups.items() if name.startswith("speed")}
    assert list(speeds) == ["speed: arm_linear, 20 %", "speed: arm_linear, 60 %", "speed: arm_linear, 100 %"]
    assert speeds["speed: arm_linear, 60 %"] == ["60.0"]
    assert strata.band(1.0, (2.0, 5.0), "px") == "below 2 px"
    assert strata.band(2.0, (2.0, 5.0), "px") == "2 to 5 px"


def test_tables_by_stratum_stand_below_the_scores(dataset):
    result = run("blur", dataset, algorithms=["none"])
    assert set(result.provenance["findings"]) == {f"{metric}_by_stratum" for metric in strata.SHOWN}
    assert "| group: synthetic | 1 | 100 | 0 |" in markdown(result)
    assert result.provenance["conditions"][FRAME]["length_px"] == synthetic.BLUR_LENGTH_PX


DEFINITION = """
task = "deconvolution"
description = "x"
do_nothing = "none"
quick_cases = 4
algorithms = ["none", "wiener", "wiener_guessed"]
[variants]
wiener_guessed = { algorithm = "wiener", blur_from = "cepstrum_minimum" }
[frames]
seed = 5
side_px = 96
[frames.textures]
gravel = { picture = "gravel", use = "test" }
[[frames.parts]]
blurred_by = "otf"
lengths_px = [2.0, 8.0]
angles_deg = [30.0]
noise_percent = [1.0]
[[frames.quick_parts]]
blurred_by = "otf"
lengths_px = [8.0]
angles_deg = [30.0]
noise_percent = [1.0]
"""
LONG, SHORT = "gravel/otf/8px/30deg/1%", "gravel/otf/2px/30deg/1%"


@pytest.fixture
def definition(tmp_path):
    path = tmp_path / "made.toml"
    path.write_text(DEFINITION)
    return str(path)


def test_deconvolution_gains_with_the_true_blur_and_loses_with_a_wrong_one(definition, tmp_path):
    code = "def deblur(image, *, blur):\n    return np.clip(image + np.float32(0.1), 0, 1)\nNEEDS = ('blur',)\n"
    result = run(definition, algorithms=["wiener", "wiener_guessed", user_file(tmp_path, code)])
    gains = values(result, "psnr_above_blurred", LONG)
    assert gains["none"] == 0
    assert gains["wiener"] > 1.5
    assert gains["mine"] < 0
    assert values(result, "made_worse_percent", "all") | {"wiener_guessed": 0} == {
        "none": 0, "wiener": 0, "wiener_guessed": 0, "mine": 100
    }  # fmt: skip
    psnr = values(result, "psnr", LONG)
    assert psnr["wiener"] - psnr["none"] == pytest.approx(gains["wiener"])
    assert values(result, "psnr_inner", LONG)["wiener"] != psnr["wiener"]
    assert "| 8 px, noise 1 % | 1 | 0 |" in markdown(result)


def test_each_deconvolver_gets_the_true_blur_or_its_estimators(definition):
    from uwsim.bench.blur_controlled.frames import Frames
    from uwsim.bench.definition import read_definition
    from uwsim.motion_blur.estimators import cepstrum_minimum

    made = Frames(read_definition(definition)[1].frames, quick=False)
    case = blur_deconvolution.case(made, LONG)
    assert case.blur(None)[:2] == (8.0, 30.0)
    assert case.blur("cepstrum_minimum") == cepstrum_minimum.estimate(case.image)
    assert case.blur("cepstrum_minimum") is case.blur("cepstrum_minimum")
    with pytest.raises(ValueError, match="'nobody', allowed"):
        case.blur("nobody")


def test_rendered_frames_are_undone_as_the_command_does_it(dataset, tmp_path, monkeypatch):
    """Setup: 8 px at 30 deg. Expected: with the label nearer to the sharp twin; what an estimator calls no blur is left
    alone. Negative control: a picture made brighter is worse."""
    code = "def deblur(image, *, blur):\n    return np.clip(image + np.float32(0.1), 0, 1)\nNEEDS = ('blur',)\n"
    chosen = ["wiener", "wiener_whittle", user_file(tmp_path, code)]
    monkeypatch.setattr(whittle, "estimate", lambda image: Estimate(8.0, 30.0, verdict="no blur"))
    result = run("blur_undone", dataset, algorithms=chosen)
    gains = values(result, "psnr_above_blurred")
    assert gains["none"] == gains["wiener_whittle"] == 0
    assert gains["wiener"] > 0.5 and gains["mine"] < 0
    assert values(result, "left_alone_percent") == {"none": 100, "wiener": 0, "wiener_whittle": 100, "mine": 0}
    assert values(result, "made_worse_percent") == {"none": 0, "wiener": 0, "wiener_whittle": 0, "mine": 100}
    picture = blur_undone.case(dataset, FRAME)
    assert values(result, "psnr")["none"] == pytest.approx(psnr(picture.truth, picture.image))


def test_without_an_estimate_there_is_no_score_but_a_reason(definition, monkeypatch):
    monkeypatch.setattr(estimates, "estimated", lambda *_: (Refusal("too bright"), math.nan))
    result = run(definition, quick=True)
    notes = {r.note for r in result.records if r.algorithm == "wiener_guessed" and r.case == LONG}
    assert "cepstrum_minimum: too bright" in notes
    assert values(result, "psnr", LONG)["wiener_guessed"] is None
    assert values(result, "psnr", LONG)["wiener"] > 20


def test_only_deconvolution_and_pose_take_blur_from_an_estimator(tmp_path):
    from uwsim.bench.definition import read_definition

    path = tmp_path / "mine.toml"
    path.write_text(
        'task = "blur"\ndescription = "x"\ndataset = "tiny"\ndo_nothing = "none"\nquick_cases = 1\n[variants]\n'
        'other = { algorithm = "none", blur_from = "whittle" }\n'
    )
    with pytest.raises(ValueError, match="other has blur_from, allowed: with tasks deconvolution, deblurring, pose"):
        read_definition(str(path))


def test_an_estimate_of_a_frame_is_not_a_number_for_a_refusal(dataset, case):
    found = field.uniform(Refusal("no"), (4, 5))
    assert np.isnan(found).all()
    assert np.array_equal(field.uniform(Estimate(4.0, 30.0, verdict="no blur"), (4, 5)), np.zeros((4, 5, 2)))
