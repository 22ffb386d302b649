"""Bayer mosaic with its interpolation, and vignetting."""

import numpy as np
import pytest

from uwsim.camera import mosaic, pinhole, sensor
from uwsim.camera.vignetting import relative_illumination

K = pinhole.camera_matrix(width_px=40, height_px=30, horizontal_fov_deg=80)
SIZE = {"width_px": 40, "height_px": 30}


@pytest.mark.parametrize("pattern", mosaic.PATTERNS)
def test_each_pixel_of_the_mosaic_has_the_band_that_the_pattern_says(pattern):
    bands = np.broadcast_to([0, 1, 2], (5, 6, 3))
    seen = mosaic.mosaic(bands, pattern=pattern)
    names = np.array(list("RGB"))[seen]
    assert "".join(names[:2, :2].ravel()) == pattern
    assert np.array_equal(names[2:4, 4:6], names[:2, :2]) and np.array_equal(names[4, 4:], names[0, :2])


@pytest.mark.parametrize("shape", [(4, 4), (5, 7), (16, 12)])
@pytest.mark.parametrize("method", mosaic.METHODS)
@pytest.mark.parametrize("pattern", mosaic.PATTERNS)
def test_an_even_image_is_interpolated_exactly(pattern, method, shape):
    bits = 8 if method == "vng" else 12
    dn = np.broadcast_to([200, 17, 101], (*shape, 3)).astype(np.uint16)
    back = mosaic.demosaic(mosaic.mosaic(dn, pattern=pattern), pattern=pattern, method=method, adc_bits=bits)
    assert np.array_equal(back, dn)


def test_control_the_wrong_pattern_swaps_the_bands():
    dn = np.broadcast_to([200, 17, 101], (8, 8, 3)).astype(np.uint16)
    back = mosaic.demosaic(mosaic.mosaic(dn, pattern="RGGB"), pattern="BGGR", method="bilinear", adc_bits=12)
    assert np.array_equal(back, dn[..., ::-1])


def test_bilinear_keeps_what_was_sampled_and_averages_the_neighbours():
    dn = np.random.default_rng(0).integers(0, 4096, (10, 12, 3)).astype(np.uint16)
    seen = mosaic.mosaic(dn, pattern="RGGB").astype(float)
    back = mosaic.demosaic(seen, pattern="RGGB", method="bilinear", adc_bits=12)
    rounding = 0.5 * 2.0**-4
    assert np.array_equal(back[2:-2:2, 2:-2:2, 0], seen[2:-2:2, 2:-2:2])
    assert back[4, 4, 1] == pytest.approx(np.mean([seen[3, 4], seen[5, 4], seen[4, 3], seen[4, 5]]), abs=rounding)
    assert back[4, 4, 2] == pytest.approx(np.mean(seen[np.ix_([3, 5], [3, 5])]), abs=rounding)


def test_methods_differ_at_an_edge_and_the_edge_aware_one_follows_it():
    """A neutral vertical edge: across it, edge-aware green takes its neighbours along the edge and stays exact."""
    dn = np.zeros((12, 12, 3), np.uint16)
    dn[:, 6:] = 3000
    seen = mosaic.mosaic(dn, pattern="RGGB")
    error = {
        method: np.abs(mosaic.demosaic(seen, pattern="RGGB", method=method, adc_bits=12) - dn)[2:-2, 2:-2, 1].max()
        for method in ("bilinear", "edge_aware")
    }
    assert error["edge_aware"] == 0 < error["bilinear"]


def test_mosaics_that_do_not_exist_are_refused():
    with pytest.raises(ValueError, match="demosaic: got 'ahd', allowed: bilinear, edge_aware, vng"):
        mosaic.check("RGGB", "ahd", adc_bits=12)
    with pytest.raises(ValueError, match="demosaic: 'vng' with adc_bits = 12, allowed: 8"):
        mosaic.check("RGGB", "vng", adc_bits=12)
    with pytest.raises(ValueError, match="mosaic: an image of 3 x 9 px, allowed: at least 4 each way"):
        mosaic.mosaic(np.zeros((9, 3, 3)), pattern="RGGB")


def test_cos4_is_the_fourth_power_of_the_cosine_of_the_rays():
    rays = pinhole.ray_directions(K, **SIZE)
    assert relative_illumination(K, cos4=True, **SIZE) == pytest.approx(rays[..., 2] ** 4, rel=1e-12)


def test_cos4_at_45_degrees_is_a_quarter_and_1_on_the_axis():
    aside = np.array([[10.0, 0, 0.5], [0, 10.0, 0.5], [0, 0, 1]])
    seen = relative_illumination(aside, width_px=11, height_px=1, cos4=True)
    assert (seen[0, 0], seen[0, 10]) == (pytest.approx(1), pytest.approx(0.25))


def test_the_polynomial_is_in_the_tangent_of_the_field_angle():
    rays = pinhole.ray_directions(K, **SIZE)
    tan2 = (rays[..., 0] ** 2 + rays[..., 1] ** 2) / rays[..., 2] ** 2
    expected = 1 - 0.3 * tan2 + 0.05 * tan2**2
    assert relative_illumination(K, cos4=False, polynomial=(-0.3, 0.05), **SIZE) == pytest.approx(expected)
    both = relative_illumination(K, cos4=True, polynomial=(-0.3, 0.05), **SIZE)
    assert both == pytest.approx(expected * rays[..., 2] ** 4)
    assert np.all(relative_illumination(K, cos4=False, **SIZE) == 1)
    with pytest.raises(ValueError, match=r"polynomial \[-2.0\] falls to -1.08 at 45.6 degrees, allowed: > 0"):
        relative_illumination(K, cos4=False, polynomial=(-2.0,), **SIZE)


def test_vignetting_dims_the_light_and_not_the_dark_current():
    settings = {
        "electrons_per_radiance": np.ones(3), "full_well_e": 1e4, "white_balance": np.ones(3), "dark_e": 100.0,
        "relative_illumination": relative_illumination(K, cos4=True, **SIZE),
    }  # fmt: skip
    fall = settings["relative_illumination"][..., None]
    linear = sensor.linear_from_radiance(np.full((30, 40, 3), 990.0), **settings)
    assert linear == pytest.approx(np.repeat(0.1 * fall, 3, axis=2), rel=1e-6)
    std = sensor.noise_std_radiance(np.full((30, 40, 3), 990.0), **settings)
    assert std == pytest.approx(np.repeat(np.sqrt(990 * fall + 100) / fall, 3, axis=2))
    digital, radiance = settings | {"adc_bits": 16}, np.full((30, 40, 3), 990.0)
    exposures = [sensor.raw_dn(radiance, rng=np.random.default_rng(seed), **digital) for seed in range(40)]
    dn = np.mean(exposures, axis=0)
    corner, middle = (dn[rows, columns].mean() / 6.5535 - 100 for rows, columns in ((0, 0), (15, 20)))
    assert middle == pytest.approx(990, rel=0.02)
    assert corner / middle == pytest.approx(fall[0, 0, 0], rel=0.08)
