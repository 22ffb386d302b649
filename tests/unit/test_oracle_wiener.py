"""The noise-aware oracle: exact without noise, better than inversion and than nothing with it, silent without light."""

import numpy as np
import pytest

from tests.unit import synthetic
from uwsim.bench import restoration
from uwsim.restoration.algorithms import oracle_inverse, oracle_wiener


def scene(noise_std=0.0, seed=0, depth=2.0):
    """Return (objects, image, truth layers) of blocks behind water that thickens to the right; linear."""
    rng = np.random.default_rng(seed)
    objects = np.kron(rng.uniform(0.05, 0.7, (12, 16, 3)), np.ones((10, 10, 1)))
    gain = np.exp(-np.array([1.2, 0.8, 1.0]) * depth * np.linspace(0.1, 1, 160)[None, :, None]) * np.ones((120, 1, 1))
    backscatter = np.array([0.05, 0.1, 0.08]) * (1 - gain)
    forward = np.full_like(gain, 0.02)
    clean = objects * gain + backscatter + forward
    image = (clean + noise_std * rng.standard_normal(clean.shape)).astype(np.float32)
    layers = {
        "backscatter": backscatter, "forward_scatter": forward, "direct_gain": gain,
        "noise_std": np.full_like(gain, max(noise_std, 1e-6)),
    }  # fmt: skip
    return objects, image, {name: values.astype(np.float32) for name, values in layers.items()}


def rms(found, objects):
    return float(np.sqrt(np.mean((found - objects) ** 2)))


def test_without_noise_the_objects_come_back():
    objects, image, layers = scene()
    # the model: backscatter is smoothed by 2 px, whose mirrored border bends it
    np.testing.assert_allclose(oracle_wiener.restore(image, **layers)[:, 8:-8], objects[:, 8:-8], atol=0.01)
    wrong = layers | {"direct_gain": layers["direct_gain"] * np.float32(0.8)}
    assert rms(oracle_wiener.restore(image, **wrong), objects) > 0.05, "control: another gain"


@pytest.mark.parametrize("noise_std", [0.01, 0.03, 0.1])
def test_with_noise_it_beats_inversion_and_nothing(noise_std):
    objects, image, layers = scene(noise_std)
    found = rms(oracle_wiener.restore(image, **layers), objects)
    inverted = oracle_inverse.restore(
        image, backscatter=layers["backscatter"] + layers["forward_scatter"], transmission=layers["direct_gain"]
    )
    assert found < 0.8 * rms(inverted, objects)
    assert found < 0.6 * rms(np.clip(image, 0, 1), objects)


def test_control_the_true_noise_is_best():
    objects, image, layers = scene(0.03)
    right = rms(oracle_wiener.restore(image, **layers), objects)
    for factor in (0.2, 5.0):
        wrong = layers | {"noise_std": layers["noise_std"] * np.float32(factor)}
        assert rms(oracle_wiener.restore(image, **wrong), objects) > 1.2 * right


def test_hopeless_noise_leaves_the_prior():
    _, image, layers = scene()
    found = oracle_wiener.restore(image, **layers | {"noise_std": np.full_like(image, 1e3)})
    np.testing.assert_allclose(found, oracle_wiener.PRIOR_MEAN, atol=1e-3)


def test_where_no_light_arrives_the_neighbourhood_stands():
    objects, image, layers = scene(0.01)
    gain = layers["direct_gain"].copy()
    gain[50:56, 60:66] = 0
    found = oracle_wiener.restore(image, **layers | {"direct_gain": gain})
    assert np.all(np.isfinite(found))
    # the value of a 15 px window about the hole, or of a wider one
    near = found[44:62, 54:72].reshape(-1, 3)
    assert np.all(found[50:56, 60:66] >= near.min(axis=0) - 0.05)
    assert np.all(found[50:56, 60:66] <= near.max(axis=0) + 0.05)


def test_refuses():
    _, image, layers = scene()
    for name in layers:
        with pytest.raises(ValueError, match=name):
            oracle_wiener.restore(image, **layers | {name: layers[name][..., 0]})
        with pytest.raises(ValueError, match=name):
            oracle_wiener.restore(image, **layers | {name: np.full_like(image, np.nan)})
    with pytest.raises(ValueError, match="noise_std"):
        oracle_wiener.restore(image, **layers | {"noise_std": 0 * image})
    with pytest.raises(ValueError, match="direct_gain"):
        oracle_wiener.restore(image, **layers | {"direct_gain": -layers["direct_gain"]})


def test_the_benchmark_makes_its_inputs(tmp_path):
    """J t + B and the sensor's noise, measured between picture and radiance."""
    frame = synthetic.write_dataset(tmp_path, frames=(1,)).frame("000001")
    makers = restoration.makers(frame)
    gain, std = makers["direct_gain"](), makers["noise_std"]()
    seen = frame.buffer("transmission") > 0
    # the model: a mean over 15 px of a transmission that changes within them
    np.testing.assert_allclose(gain[seen], frame.buffer("transmission")[seen], rtol=0.15)
    from uwsim.bench.task import linear_buffer
    from uwsim.images import linear_from_srgb_uint8

    ratio = (linear_from_srgb_uint8(frame.image) - linear_buffer(frame, "radiance")) / std
    middle = (frame.image > 5) & (frame.image < 250)
    # Monte Carlo: 30 000 pixels; dark levels are rounded coarsely
    assert 0.9 < np.std(ratio[middle]) < 1.1
