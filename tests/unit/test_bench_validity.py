"""The validity benchmark on frames made by formula: a model that is that formula has no error, others their own."""

import json

import numpy as np
import pytest
import synthetic_validity

from uwsim.bench.definition import read_definition
from uwsim.bench.records import result_from_dict
from uwsim.bench.run import load, run
from uwsim.bench.validity import task, truth
from uwsim.bench.validity.fit import fit
from uwsim.bench.validity.grain import grain_of

MODEL = '''"""Direct light in grey water, and an even veil of `veil` times the mean reflectance-free light."""
import numpy as np
from uwsim.formation.bands import band_values
PARAMETERS = {"c_per_m": (0.05, 8.0), "veil": (0.0, 0.1)}
def layers(view, *, c_per_m=1.0, veil=0.0, form="right"):
    light = np.zeros((*view.shape, 3))
    for lamp in view.lamps:
        a = lamp.arriving(view.points_m)
        cosine = np.maximum((a.towards * view.normals).sum(-1), 0)
        share = np.exp(-c_per_m * (view.range_m + a.path_m)) * view.albedo[..., 0] / np.pi
        light += (a.irradiance_per_intensity * cosine * share)[..., None] * band_values(view, lamp.spectrum)
    if form == "wrong":
        light = 2 * light
    back = np.full_like(light, veil)
    return {"direct": light, "backscatter": back, "radiance": light + back}
'''
TOML = """task = "validity"
description = "Test."
dataset = "tiny"
algorithms = ["no_water", "fitted", "wrong", "bare", "oracle_noise"]
do_nothing = "no_water"
oracle = "oracle_noise"
quick_cases = 1
[variants.fitted]
algorithm = "MODEL"
fitted = true
[variants.wrong]
algorithm = "MODEL"
keywords = { form = "wrong", c_per_m = 0.5 }
[variants.bare]
algorithm = "MODEL"
keywords = { c_per_m = 0.5 }
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic_validity.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


@pytest.fixture(scope="module")
def result(dataset, tmp_path_factory):
    folder = tmp_path_factory.mktemp("definition")
    (folder / "model.py").write_text(MODEL)
    (folder / "mine.toml").write_text(TOML.replace("MODEL", str(folder / "model.py")))
    return run(str(folder / "mine.toml"), dataset)


def value(result, case, algorithm, metric):
    found = [r for r in result.records if (r.case, r.algorithm, r.metric) == (case, algorithm, metric)]
    assert len(found) == 1
    return found[0].value


def test_the_right_parameters_are_found_and_leave_no_error(result):
    # 000000 has c = 0.5 /m; its noise of 5 % lets errors below 0.9 % pass
    assert value(result, "000000", "fitted", "relative_radiance_error") < 2
    notes = [r.note for r in result.records if (r.case, r.algorithm) == ("000000", "fitted") and "c_per_m" in r.note]
    assert len(notes) == 1
    found = dict(part.split(" = ") for part in notes[0].partition(" (")[0].split(", "))
    assert float(found["c_per_m"]) == pytest.approx(0.5, abs=0.02)


def test_control_wrong_parameters_and_missing_layers_show(result):
    assert value(result, "000000", "wrong", "relative_radiance_error") > 50
    assert value(result, "000000", "wrong", "direct_error") == pytest.approx(100, abs=3)
    assert value(result, "000000", "bare", "backscatter_error") == pytest.approx(100)
    assert value(result, "000000", "bare", "direct_error") < 3
    assert value(result, "000000", "no_water", "relative_radiance_error") > 50


def test_the_oracle_is_as_good_as_the_noise_allows(result):
    for case in ("000000", "000001", "000002"):
        # the noise of both, less the truth's own: within what its chance leaves over
        assert value(result, case, "oracle_noise", "relative_radiance_error") < 2
        assert value(result, case, "oracle_noise", "psnr") > value(result, case, "no_water", "psnr") + 10


def test_the_reflectance_is_the_pixels_own(dataset):
    known = truth.Truth(dataset.frame("000000"))
    made = synthetic_validity.direct(known.view, 0.5, known.view.albedo[..., 0])
    noise = known.layers["direct"] - made
    assert abs(noise.mean()) < 0.01 * made.mean()
    assert np.std(noise / made) < 1.5 * synthetic_validity.NOISE
    # control: the albedo at the pixels' centres misses what the bars cover of them
    centre = synthetic_validity.direct(known.view, 0.5, known.frame.buffer("albedo")[..., 0])
    assert np.std((known.layers["direct"] - centre) / made) > 4 * synthetic_validity.NOISE
    with pytest.raises(ValueError, match="read-only"):
        known.view.albedo[0] = 0


def test_a_case_below_the_sensors_noise_is_reported_as_such(result):
    assert value(result, "000002", "fitted", "direct_error") is None
    assert value(result, "000002", "fitted", "contrast_error") is None
    assert value(result, "000002", "fitted", "backscatter_error") is not None
    assert result.provenance["conditions"]["000002"]["below_sensor_noise"]
    assert not result.provenance["conditions"]["000000"]["below_sensor_noise"]
    assert any("below sensor noise" in text and "000002" in text for text in result.provenance["cameras"])


def test_conditions_say_what_the_frame_was_like(result):
    found = result.provenance["conditions"]["000001"]
    assert found["attenuation_per_m"] == 2
    assert found["single_scattering_albedo"] == pytest.approx(0.3)
    assert found["optical_depth"] == pytest.approx(2 * found["range_m"], rel=1e-3)
    assert found["lamp_offset_m"] == pytest.approx(0.3)
    assert found["phase"] == "Henyey-Greenstein, g = 0.9"
    assert found["monte_carlo_noise_percent"] == pytest.approx(5, rel=0.05)
    assert sum(found["shares"].values()) == pytest.approx(1, rel=1e-3)


def test_the_format_of_results_stays(result):
    content = json.loads(result.to_json())
    assert set(content) == {"benchmark", "provenance", "records"}
    assert set(content["records"][0]) == {"case", "algorithm", "given", "metric", "value", "unit", "better"}
    assert result_from_dict(content) == result
    assert {r.metric for r in result.records if r.case == "all"} == set(task.STATISTICS)
    assert {r.metric for r in result.records if r.case == "000000"} == {*task.STATISTICS, *task.DETAILS}


def test_contrast_groups_follow_from_range_and_lens(dataset):
    known = truth.Truth(dataset.frame("000000"))
    # 1 m / 110 px = 9.1 mm per pixel: 0.4 cycles/px are 0.044 line pairs/mm, 4 cycles in 72 px are 0.006
    assert known.chart_groups == (-7, -6)
    found = known.transfer(known.radiance, noisy=True)
    expected = known.layers["direct"].mean() / known.radiance.mean()
    assert found.value == pytest.approx([expected] * 2, rel=0.1)  # model: the lamp's fall-off in water is another
    assert np.all(found.standard_error < 0.05 * found.value)


@pytest.mark.parametrize(
    ("code", "parts"),
    [
        ("def layers(view):\n    return view.albedo", ["returned", "direct"]),
        ("def layers(view):\n    return {'direct': view.albedo[:2]}", ["direct", "(72, 96, 3)"]),
        ("import numpy as np\ndef layers(view):\n    return {'direct': np.full((72, 96, 3), np.nan)}", ["finite"]),
        (
            "import numpy as np\ndef layers(view):\n    return {'direct': np.ones((72, 96, 3)), 'radiance': 2.0}",
            ["sum"],
        ),
        ("def layers(view):\n    view.albedo[0] = 1", ["read-only"]),
        ("NEEDS = ('range_m',)\ndef layers(view, range_m):\n    pass", ["NEEDS", "range_m", "water_free"]),
        ("def model(view):\n    pass", ["layers()"]),
    ],
)
def test_broken_models_are_refused_in_one_line(dataset, tmp_path, code, parts):
    path = tmp_path / "broken.py"
    path.write_text(code)
    with pytest.raises(ValueError) as caught:
        run("validity", dataset, algorithms=["no_water", str(path)])
    assert "\n" not in str(caught.value)
    assert all(part in str(caught.value) for part in ["broken", *parts]), caught.value


def test_a_fit_needs_parameters(dataset, tmp_path):
    (tmp_path / "model.py").write_text("def layers(view):\n    return {}")
    (tmp_path / "mine.toml").write_text(TOML.replace("MODEL", str(tmp_path / "model.py")))
    with pytest.raises(ValueError, match="PARAMETERS is None"):
        run(str(tmp_path / "mine.toml"), dataset)


def test_fit_takes_vectors_and_keeps_the_defaults_where_they_are_best():
    target = np.array([0.3, 3.0, 30.0]) * np.ones((4, 4, 1))

    def layers(view, *, scale=None):
        return np.broadcast_to((0.3, 3.0, 30.0) if scale is None else scale, (4, 4, 3))

    one = {"view": None, "target": target, "compose": lambda output: output}
    assert fit(layers, {"scale": ((0.01,) * 3, (100.0,) * 3)}, **one).parameters == {}
    moved = fit(layers, {"scale": ((0.01,) * 3, (100.0,) * 3)}, **one | {"target": 1.1 * target}).parameters["scale"]
    assert moved == pytest.approx((0.33, 3.3, 33.0), rel=0.02)
    with pytest.raises(ValueError, match="low below high"):
        fit(layers, {"scale": (2.0, 1.0)}, **one)


def test_the_grain_is_as_fine_as_the_noise_allows():
    truth_light = np.ones((64, 96, 3))
    fine, coarse = (grain_of(truth_light, standard_error=share * truth_light, batches=16) for share in (0.05, 0.3))
    assert (fine.size_px, coarse.size_px) == (1, 8)
    assert max(fine.resolution_percent, coarse.resolution_percent) <= 2
    assert coarse.relative_error(truth_light, 1.05 * truth_light, standard_error=0 * truth_light) == pytest.approx(5)


def test_a_bright_path_is_left_out_where_it_holds_little_light():
    light, error = np.ones((64, 96, 3)), np.full((64, 96, 3), 0.05)
    light[3, 4], error[3, 4] = 40.0, 39.0
    found = grain_of(light, standard_error=error, batches=16)
    assert found.size_px == 1
    assert not found.kept[3, 4]
    assert found.kept.sum() == 64 * 96 - 1
    assert found.left_out_percent == pytest.approx(100 * 40 / (64 * 96 + 39))
    light[3, 4], error[3, 4] = 400.0, 390.0  # control: what is left out counts as not known
    found = grain_of(light, standard_error=error, batches=16)
    assert found.left_out_percent == pytest.approx(100 * 400 / (64 * 96 + 399), rel=0.05)
    assert found.resolution_percent > found.left_out_percent


def test_variants_are_checked(tmp_path):
    def read(text):
        (tmp_path / "mine.toml").write_text(text)
        return read_definition(str(tmp_path / "mine.toml"))[1]

    good = TOML.replace("MODEL", "no_water")
    assert load(task.TASK, "wrong", read(good).variants).module.layers.keywords["form"] == "wrong"
    for old, new, part in (
        ('"wrong", "bare"', '"bare"', "wrong"),
        ("fitted = true", "speed = 1", "unknown key"),
        ('task = "validity"', 'task = "blur"', "allowed: with task validity"),
    ):
        with pytest.raises(ValueError, match=part):
            read(good.replace(old, new))
