"""Mistakes seen in other simulators do not happen here."""

import numpy as np

from uwsim.camera import sensor
from uwsim.images import linear_from_srgb_uint8, srgb_uint8_from_linear

SENSOR = {
    "electrons_per_radiance": np.array([4e5, 7e5, 6e5]),
    "full_well_e": 1e4,
    "white_balance": np.array([1.3, 1.0, 1.6]),
}


def test_attenuation_acts_on_linear_light_never_on_encoded_values():
    """Setup: radiance dimmed by 0.3 before the sensor. Expected: the stored picture decodes to 0.3 of the other's
    linear light (8-bit steps). Negative control: multiplying encoded values, as some simulators do, is far off."""
    radiance = np.linspace(1e-3, 8e-3, 64)[:, None, None] * np.ones((64, 4, 3))
    bright = sensor.expose_without_noise(radiance, **SENSOR)
    dim = sensor.expose_without_noise(0.3 * radiance, **SENSOR)
    expected = 0.3 * linear_from_srgb_uint8(bright)
    assert np.abs(linear_from_srgb_uint8(dim) - expected).max() < 0.006
    in_gamma_space = linear_from_srgb_uint8(np.rint(0.3 * bright).astype(np.uint8))
    assert np.abs(in_gamma_space - expected).max() > 0.05


def test_no_scale_is_fitted_to_an_image():
    """The same radiance gives the same values whatever else is in the picture."""
    small = np.full((4, 4, 3), 2e-3)
    beside_bright = np.concatenate([small, np.full((4, 4, 3), 1e-2)])
    alone = sensor.expose_without_noise(small, **SENSOR)
    assert np.array_equal(alone, sensor.expose_without_noise(beside_bright, **SENSOR)[:4])
    assert not np.array_equal(alone, srgb_uint8_from_linear(small / small.max()))
