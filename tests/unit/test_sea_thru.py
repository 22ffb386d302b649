"""Fit of backscatter and range-dependent attenuation on pictures made by the method's own forms."""

import numpy as np
import pytest

from uwsim.restoration.algorithms import sea_thru

VEIL, RISE, DECAY = np.array([0.05, 0.2, 0.15]), np.array([1.2, 0.6, 0.8]), np.array([0.9, 0.3, 0.4])


def scene(seed=0, height=90, width=160):
    """Return (objects, picture, range): a slanted wall of mean 0.5 in daylight, a twentieth of it black."""
    rng = np.random.default_rng(seed)
    range_m = np.broadcast_to(np.linspace(0.5, 3.0, width, dtype=np.float32), (height, width)).copy()
    objects = rng.uniform(0.3, 0.75, (height, width, 1)) * np.ones(3)
    objects[rng.random((height, width)) < 0.05] = 0
    z = range_m[..., None]
    picture = objects * np.exp(-DECAY * z) + VEIL * (1 - np.exp(-RISE * z))
    return objects, picture.astype(np.float32), range_m


def test_backscatter_of_black_pixels_is_found():
    _, picture, range_m = scene()
    seen = np.ones(range_m.shape, bool)
    z = np.linspace(0.5, 3.0, 20)
    for channel in range(3):
        fit = sea_thru.backscatter_fit(picture, range_m, seen, channel)
        truth = VEIL[channel] * (1 - np.exp(-RISE[channel] * z))
        np.testing.assert_allclose(sea_thru.backscatter(z, fit), truth, atol=0.01 * VEIL[channel])
        # control: a tenth more is told apart
        assert np.abs(sea_thru.backscatter(z, fit) - 1.1 * truth).max() > 0.01 * VEIL[channel]


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_attenuation_that_falls_with_range_is_found(slope):
    z = np.linspace(0.5, 3.0, 4000)
    per_m = 0.6 * np.exp(-slope * z)
    fit = sea_thru.attenuation_fit(np.exp(-per_m * z), z)
    np.testing.assert_allclose(sea_thru.attenuation(z, fit), per_m, rtol=0.02)


def test_control_another_light_gives_another_attenuation():
    z = np.linspace(0.5, 3.0, 4000)
    fit = sea_thru.attenuation_fit(0.5 * np.exp(-0.6 * z), z)
    assert sea_thru.attenuation(0.5, fit) > 1.2


def test_a_wall_in_daylight_is_restored_up_to_one_gain():
    objects, picture, range_m = scene()
    restored = sea_thru.restore(picture, range_m=range_m)
    lit = objects[..., 0] > 0

    def spread(image):
        """Return how unlike the object's an image's brightness is, over the picture and the channels."""
        ratio = image[lit] / objects[lit]
        return float(ratio.std() / ratio.mean())

    # model: the local light is a mean over neighbours of a random texture
    assert spread(restored) < 0.08
    assert spread(picture) > 0.35


def test_nothing_seen_stays_black():
    _, picture, range_m = scene()
    range_m[:10] = np.inf
    restored = sea_thru.restore(picture, range_m=range_m)
    assert np.all(restored[:10] == 0)
    assert restored[10:].max() == 1


@pytest.mark.parametrize("fault", ["shape", "nan", "zero", "nothing"])
def test_refuses_other_ranges(fault):
    _, picture, range_m = scene()
    if fault == "shape":
        range_m = range_m[1:]
    else:
        range_m[:] = {"nan": np.nan, "zero": 0, "nothing": np.inf}[fault]
    with pytest.raises(ValueError, match="range_m"):
        sea_thru.restore(picture, range_m=range_m)
