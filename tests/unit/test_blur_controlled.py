"""Frames of exactly known blur: made alone or together the same, of the length and angle they say, and scored so."""

import math
import pickle

import numpy as np
import pytest

from uwsim.bench.blur import estimates
from uwsim.bench.blur_controlled import frames as making
from uwsim.bench.blur_controlled import task, textures
from uwsim.bench.blur_controlled.frames import Frames, Shot, blurred_source, sub_frames
from uwsim.bench.blur_controlled.protocol import Protocol, Texture
from uwsim.bench.definition import read_definition
from uwsim.bench.records import markdown
from uwsim.bench.run import TASKS, run, source
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.estimators import oracle_sharp
from uwsim.validation import validated, with_tuples

SIDE = 96
GRAVEL = {"picture": "gravel", "use": "test"}
FIELD = {"exponent": 2.8, "std": 0.12, "use": "tuning"}


def part(**changes) -> dict:
    return {"blurred_by": "otf", "lengths_px": [4.0], "angles_deg": [30.0], "noise_percent": [0.0], **changes}


def protocol(*parts: dict, quick: dict | None = None, **textures_) -> Protocol:
    values = {
        "seed": 3, "side_px": SIDE, "textures": textures_ or {"gravel": GRAVEL, "field": FIELD},
        "parts": list(parts) or [part()], "quick_parts": [quick or part()],
    }  # fmt: skip
    return validated(Protocol, with_tuples(values), where="here")


def frames(*parts: dict, **keywords) -> Frames:
    return Frames(protocol(*parts, **keywords), quick=False)


def definition_file(folder, **changes) -> str:
    values = {
        "task": '"blur_controlled"', "description": '"x"', "do_nothing": '"none"', "quick_cases": "9",
        "algorithms": '["none", "cepstrum_minimum"]', **changes,
    }  # fmt: skip
    lines = [f"{key} = {value}" for key, value in values.items()]
    lines += [
        "[frames]", "seed = 3", f"side_px = {SIDE}", "[frames.textures]",
        'gravel = { picture = "gravel", use = "test" }', 'field = { exponent = 2.8, std = 0.12, use = "tuning" }',
        "[[frames.parts]]", 'blurred_by = "sub_frames"', "lengths_px = [0.0, 10.0]", "angles_deg = [30.0]",
        "noise_percent = [0.5]",
        "[[frames.quick_parts]]", 'blurred_by = "otf"', 'textures = ["gravel"]', "lengths_px = [10.0]",
        "angles_deg = [30.0]", "noise_percent = [0.5]",
    ]  # fmt: skip
    path = folder / "mine.toml"
    path.write_text("\n".join(lines))
    return str(path)


def values(result, metric: str, case: str = "all") -> dict:
    return {r.algorithm: r.value for r in result.records if r.metric == metric and r.case == case}


def test_shipped_protocols_read_and_their_pictures_are_there():
    for name in ("blur_controlled", "blur_deconvolution"):
        found = read_definition(name)[1].frames
        made, quick = (Frames(found, quick=one) for one in (False, True))
        assert len(quick.shots) < len(made.shots) / 10
        assert {shot.texture for shot in made.shots.values()} == set(found.textures)
        uses = {texture.use: [] for texture in found.textures.values()}
        for texture in found.textures.values():
            uses[texture.use].append(texture.picture)
            if texture.picture:
                assert min(textures.picture(texture.picture).shape) >= found.side_px + 20 + 2 * 2
        assert not set(uses["tuning"]) - {None} & set(uses["test"])
    assert len(Frames(read_definition("blur_controlled")[1].frames, quick=False).shots) > 5000


def test_the_pictures_come_with_the_package():
    """Nothing is fetched at run time: each file that is read lies in scikit-image's folder as installed."""
    from importlib.metadata import files

    shipped = {path.name.partition(".")[0] for path in files("scikit-image") if path.parent.name == "data"}
    renamed = {"cat": "chelsea", "immunohistochemistry": "ihc"}
    assert {renamed.get(name, name) for name in textures.PICTURES} <= shipped
    assert "eagle" not in shipped  # one that skimage.data would fetch


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"textures": {"a": {"use": "test"}}}, ["textures.a", "picture", "exponent"]),
        ({"textures": {"a": {"exponent": 2.0, "use": "test"}}}, ["textures.a", "exponent and std"]),
        ({"textures": {"a": {**GRAVEL, "std": 0.1}}}, ["textures.a", "either picture"]),
        ({"parts": [part(places=2)]}, ["parts.0", "places", "lengths [0.0]"]),
        ({"parts": [part(textures=["grass"])]}, ["grass", "gravel"]),
        ({"parts": [part(blurred_by="box")]}, ["blurred_by", "box", "sub_frames"]),
        ({"parts": [part(lengths_px=[41.0])]}, ["lengths_px", "41.0", "<= 40"]),
        ({"side_px": 300}, ["side_px", "300", "<= 256"]),
    ],
)
def test_a_broken_protocol_is_refused_in_one_line(change, parts):
    good = protocol().model_dump()
    with pytest.raises(ValueError) as caught:
        validated(Protocol, with_tuples(good | change), where="here")
    assert "\n" not in str(caught.value)
    assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_a_frame_is_the_same_alone_and_among_others():
    """Control: another noise, another seed and another draw of a field are other frames."""
    name = "field/otf/4px/30deg/1%"
    alone = frames(part(noise_percent=[1.0])).frame(name)
    among = frames(part(lengths_px=[2.0, 4.0], angles_deg=[0.0, 30.0], noise_percent=[0.0, 1.0]))
    assert np.array_equal(alone.image, among.frame(name).image)
    assert np.array_equal(alone.sharp, among.frame(name).sharp)
    assert not np.array_equal(alone.sharp, among.frame("field/otf/4px/0deg/1%").sharp)
    other = Frames(protocol(part(noise_percent=[1.0])).model_copy(update={"seed": 4}), quick=False)
    assert not np.array_equal(alone.image, other.frame(name).image)
    with pytest.raises(ValueError, match="'x', allowed: one of the 2"):
        frames().frame("x")


def test_a_frame_has_256_levels_and_the_noise_it_states():
    """Tolerance: Monte Carlo, five standard errors of a standard deviation over 96 x 96 pixels."""
    made = frames(part(noise_percent=[0.0, 2.0]))
    found = made.frame("gravel/otf/4px/30deg/2%")
    assert found.image.dtype == np.float32
    assert found.image.shape == (SIDE, SIDE, 3)
    assert np.array_equal(found.image[..., 0], found.image[..., 2])
    assert np.abs(255 * found.image - np.rint(255 * found.image)).max() < 1e-4
    clean = made.frame("gravel/otf/4px/30deg/0%")
    noise = (found.image - clean.image)[..., 0].astype(float)
    inside = (found.image[..., 0] > 0.1) & (found.image[..., 0] < 0.9)
    expected = math.hypot(found.noise_std, clean.noise_std)
    assert np.std(noise[inside]) == pytest.approx(expected, rel=5 / math.sqrt(2 * inside.sum()))
    assert clean.noise_std == pytest.approx(1 / 255 / math.sqrt(12))


def test_nothing_comes_in_from_the_other_side():
    """Expected: the frame of a crop is that of the whole picture. Control: blurred as a periodic frame it is not."""
    shot = Shot("gravel", "otf", 20.0, 30.0, 0.0)
    whole = blurred_source(textures.picture("gravel"), shot)
    crop = textures.crop(Texture(picture="gravel", use="test"), place=0, side_px=256, margin_px=12)
    found = making._middle(blurred_source(crop, shot), 256)
    expected = making._middle(whole, 256)
    assert np.abs(found - expected).max() < 0.25 / 255
    from uwsim.motion_blur.kernels import blur

    periodic = blur(making._middle(textures.picture("gravel"), 256).copy(), length_px=20.0, angle_deg=30.0)
    assert np.abs(periodic - expected).max() > 10 / 255


@pytest.mark.parametrize(("kind", "factor"), [("otf", 1.0), ("sub_frames", 1.0), ("sub_frames_with_ends", None)])
def test_frames_have_the_length_and_angle_they_say(kind, factor):
    """Measured by least squares against the sharp frame. Control: sub-frames with both ends make n / (n - 1) times
    the length, which the tolerance must not let pass. Tolerance: model, sinc of whole against that of sub-frames."""
    name = f"gravel/{kind}/4px/30deg/0%"
    made = frames(part(blurred_by=kind)).frame(name)
    sharp = np.repeat(made.sharp[..., None], 3, axis=-1)
    found = oracle_sharp.estimate(made.image, sharp=sharp)
    count = sub_frames(4.0)
    assert found.length_px == pytest.approx(4.0 * (factor or count / (count - 1)), abs=0.02)
    assert (abs(found.length_px - 4.0) < 0.05) == (factor is not None)
    assert found.angle_deg == pytest.approx(30.0, abs=0.3)


def test_sub_frames_and_the_formula_are_the_same_but_for_their_number():
    """(sin(pi s) / (pi s) over sin(pi s / n) n) at the highest frequency: 1 % at four sub-frames per pixel."""
    shots = [Shot("gravel", kind, 8.0, 75.0, 0.0) for kind in ("otf", "sub_frames", "sub_frames_with_ends")]
    exact, averaged, wrong = (making.transfer((64, 64), shot) for shot in shots)
    assert np.abs(averaged.imag).max() < 1e-12
    assert np.abs(averaged - exact).max() < 0.01
    assert np.abs(wrong - exact).max() > 0.03


def test_a_field_has_the_spectrum_that_its_bound_is_made_with():
    """Mean periodogram of draws over the density, in three rings. Tolerance: Monte Carlo, five standard errors.

    Control: an exponent that is off by 0.2, of the same standard deviation, is seen in some ring.
    """
    texture = Texture(**FIELD)
    side, draws = textures.LARGEST_CROP_PX, 6
    power = np.mean(
        [
            np.abs(np.fft.fft2(textures.drawn_field(texture, rng=np.random.default_rng(seed)))) ** 2 / side**2
            for seed in range(draws)
        ],
        axis=0,
    )  # fmt: skip
    frequencies = np.fft.fftfreq(side)
    u, v = frequencies[None, :], frequencies[:, None]
    expected = textures.field_spectrum(texture).texture_psd(u, v)
    wrong = textures.field_spectrum(Texture(exponent=3.0, std=0.12, use="test")).texture_psd(u, v)
    seen = []
    for low, high in ((0.02, 0.05), (0.1, 0.2), (0.3, 0.45)):
        ring = (np.hypot(u, v) >= low) & (np.hypot(u, v) < high)
        spread = 5 / math.sqrt(ring.sum() / 2 * draws)
        assert np.mean(power[ring] / expected[ring]) == pytest.approx(1, abs=spread)
        seen.append(abs(np.mean(power[ring] / wrong[ring]) - 1) > 2 * spread)
    assert any(seen)


def test_places_are_other_crops_and_fields_are_drawn_anew():
    made = frames(part(lengths_px=[0.0], places=5))
    assert len(made.shots) == 10
    for texture in ("gravel", "field"):
        names = [name for name in made.shots if name.startswith(texture)]
        pictures = [made.frame(name).sharp for name in names]
        assert len({picture.tobytes() for picture in pictures}) == 5
        assert all(picture.shape == (SIDE, SIDE) for picture in pictures)


def case_of(length_px: float = 4.0, angle_deg: float = 30.0):
    made = frames(part(lengths_px=[length_px], angles_deg=[angle_deg]))
    return task.case(made, next(iter(made.shots)))


class Says:
    """A module whose estimator gives one answer, or refuses."""

    INPUT, NEEDS = "linear_float32", ()

    def __init__(self, answer):
        self.answer = answer

    def estimate(self, image):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


def scored(answer, case) -> dict:
    return task.score(Says(answer), "says", (), case)


def test_an_estimate_is_held_against_truth_bound_and_its_own_word():
    case = case_of()
    exact = scored(Estimate(4.0, 30.0), case)
    assert exact["failure_percent"] == exact["length_error_px"] == exact["angle_error_deg"] == 0
    off = scored(Estimate(4.3, 27.0, covariance=np.diag([0.01, 4.0])), case)
    assert off["length_error_px"] == pytest.approx(0.3)
    assert off["angle_error_deg"] == pytest.approx(3.0)
    assert off["length_error_to_bound_ratio"] == pytest.approx(0.3 / (0.6745 * case.truth.bound_sd[0]), rel=1e-4)
    assert off["angle_error_to_bound_ratio"] == pytest.approx(3.0 / (0.6745 * case.truth.bound_sd[1]), rel=1e-4)
    assert (off["length_error_to_sd"], off["angle_error_to_sd"]) == pytest.approx((3.0, 1.5))
    assert off["failure_percent"] == off["refused_percent"] == 0
    assert math.isnan(exact["length_error_to_sd"])
    assert math.isnan(exact["sharp_called_blurred_percent"])


def test_the_wrong_sense_of_angles_is_a_failure():
    """y down instead of up: 150 degrees for 30."""
    assert scored(Estimate(4.0, 150.0), case_of())["failure_percent"] == 100
    assert scored(Estimate(4.0, 150.0), case_of(angle_deg=150.0))["failure_percent"] == 0


def test_numbers_count_whatever_the_verdict_and_a_refusal_says_why():
    for verdict in ("no blur", "not uniform"):
        hesitant = scored(Estimate(4.0, 30.0, verdict=verdict), case_of())
        assert (hesitant["failure_percent"], hesitant["refused_percent"]) == (0, 100)
        assert math.isnan(hesitant["kept_failure_percent"])
        assert scored(Estimate(9.0, 30.0, verdict=verdict), case_of())["failure_percent"] == 100
    for length_px, failed in ((4.0, 0), (9.0, 100)):
        kept = scored(Estimate(length_px, 30.0), case_of())
        assert (kept["kept_failure_percent"], kept["refused_percent"]) == (failed, 0)
    refused = scored(ValueError("too bright"), case_of())
    assert refused["failure_percent"] == refused["refused_percent"] == 100
    assert refused["note"] == "too bright"
    assert math.isnan(refused["length_error_px"])
    with pytest.raises(ValueError, match="ZeroDivisionError"):
        scored(ZeroDivisionError("broken"), case_of())
    with pytest.raises(ValueError, match="verdict 'perhaps', allowed: blur"):
        scored(Estimate(4.0, 30.0, verdict="perhaps"), case_of())


def test_sharp_frames_have_one_score():
    case = case_of(length_px=0.0)
    for answer, called in (
        (Estimate(2.5, 10.0), 100),
        (Estimate(1.5, 10.0), 0),
        (Estimate(9.0, 10.0, verdict="no blur"), 0),
    ):
        found = scored(answer, case)
        assert found["sharp_called_blurred_percent"] == called
        assert all(math.isnan(found[metric]) for metric in estimates.STATISTICS)


def test_a_run_needs_no_dataset_and_can_be_quick_and_gone_on_with(tmp_path):
    path = definition_file(tmp_path)
    result = run(path, checkpoint=tmp_path / "scores.jsonl")
    names = ["gravel/sharp/0.5%", "gravel/sub_frames/10px/30deg/0.5%", "field/sharp/0.5%",
             "field/sub_frames/10px/30deg/0.5%"]  # fmt: skip
    assert list(result.provenance["conditions"]) == names
    # the bound stands beside the scores, and is the one in them
    scores = {(one.case, one.algorithm, one.metric): one.value for one in result.records}
    for name, one in result.provenance["conditions"].items():
        for quantity, unit in (("length", "px"), ("angle", "deg")):
            found = [(scores[name, method, f"{quantity}_error_{unit}"],
                      scores[name, method, f"{quantity}_error_to_bound_ratio"])
                     for method in {record.algorithm for record in result.records}]  # fmt: skip
            bound = one[f"{quantity}_bound_{unit}"]
            assert (bound is None) == (one["length_px"] == 0)
            for error, ratio in found if bound else ():
                assert error == pytest.approx(0.6745 * bound * ratio, rel=1e-3)
    assert values(result, "length_error_px", names[1])["none"] == 10
    assert values(result, "failure_percent") == {"none": 100, "cepstrum_minimum": 0}
    assert values(result, "sharp_called_blurred_percent") == {"none": 0, "cepstrum_minimum": 100}
    assert result.provenance["summaries"] == ["all", "test"]
    assert result.provenance["dataset"]["seed"] == 3
    assert len(result.provenance["dataset"]["sha256"]) == 64
    assert "| length: 10 px | 2 | 100 | 0 |" in markdown(result)
    again = run(path, checkpoint=tmp_path / "scores.jsonl", resume=True)
    assert again.records == result.records
    quick = run(path, quick=True)
    assert list(quick.provenance["conditions"]) == ["gravel/otf/10px/30deg/0.5%"]


def test_worker_processes_can_open_the_frames():
    title, definition = read_definition("blur_controlled")
    found, open_frames = source(title, TASKS["blur_controlled"], definition, None, quick=True)
    assert pickle.loads(pickle.dumps(open_frames))().shots == found.shots


def test_a_dataset_is_for_benchmarks_that_make_none(tmp_path):
    with pytest.raises(ValueError, match="mine: dataset: got a dataset, allowed: none"):
        run(definition_file(tmp_path), object())
    with pytest.raises(ValueError, match="blur: dataset: got none, allowed: a dataset"):
        run("blur")
    path = definition_file(tmp_path, dataset='"tiny"')
    with pytest.raises(ValueError, match="dataset: given with task blur_controlled, allowed: frames alone"):
        read_definition(path)
    path = definition_file(tmp_path, task='"blur"', dataset='"tiny"')
    with pytest.raises(ValueError, match="frames: given with task blur, allowed: dataset alone"):
        read_definition(path)
