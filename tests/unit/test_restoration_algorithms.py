"""What single restoration methods do to constructed images."""

import numpy as np
import pytest

from uwsim.metrics.image import psnr
from uwsim.restoration.algorithms import clahe, none, oracle_inverse


def scene(seed=0, height=48, width=64):
    """Return (object, backscatter, transmission) of a slanted wall in green water, linear."""
    rng = np.random.default_rng(seed)
    objects = rng.uniform(0.05, 0.6, (height, width, 3)).astype(np.float32)
    range_m = np.linspace(0.5, 2.0, width)[None, :, None]
    transmission = np.exp(-np.array([0.9, 0.3, 0.5]) * range_m) * np.ones((height, 1, 1))
    backscatter = np.array([0.02, 0.2, 0.12]) * (1 - transmission)
    return objects, backscatter.astype(np.float32), transmission.astype(np.float32)


def test_none_returns_a_copy():
    image = np.random.default_rng(0).integers(0, 256, (8, 9, 3), dtype=np.uint8)
    restored = none.restore(image)
    np.testing.assert_array_equal(restored, image)
    assert not np.shares_memory(restored, image)


class TestOracleInverse:
    def test_undoes_the_image_formation(self):
        objects, backscatter, transmission = scene()
        image = objects * transmission + backscatter
        restored = oracle_inverse.restore(image, backscatter=backscatter, transmission=transmission)
        # round-off: float32 divided by transmissions down to 0.1
        np.testing.assert_allclose(restored, objects, atol=1e-5)

    def test_control_wrong_backscatter_is_seen(self):
        objects, backscatter, transmission = scene()
        image = objects * transmission + backscatter
        restored = oracle_inverse.restore(image, backscatter=0 * backscatter, transmission=transmission)
        assert np.abs(restored - objects).max() > 0.1

    def test_gain_is_limited_and_nothing_seen_stays_black(self):
        image = np.full((4, 4, 3), 0.05, np.float32)
        transmission = np.full((4, 4, 3), 1e-3, np.float32)
        transmission[0] = 0
        restored = oracle_inverse.restore(image, backscatter=0 * image, transmission=transmission)
        assert np.all(restored[0] == 0)
        np.testing.assert_allclose(restored[1:], 0.05 / oracle_inverse.SMALLEST_TRANSMISSION, rtol=1e-6)

    def test_result_is_clipped(self):
        image = np.full((4, 4, 3), 0.5, np.float32)
        image[0] = 0.1
        backscatter = np.full_like(image, 0.2)
        restored = oracle_inverse.restore(image, backscatter=backscatter, transmission=np.full_like(image, 0.2))
        assert np.all(restored[0] == 0)
        assert np.all(restored[1:] == 1)

    def test_refuses_other_shapes_and_nan(self):
        objects, backscatter, transmission = scene()
        with pytest.raises(ValueError, match="transmission"):
            oracle_inverse.restore(objects, backscatter=backscatter, transmission=transmission[..., 0])
        backscatter[0, 0, 0] = np.nan
        with pytest.raises(ValueError, match="backscatter"):
            oracle_inverse.restore(objects, backscatter=backscatter, transmission=transmission)


class TestClahe:
    def test_stretches_low_contrast(self):
        rng = np.random.default_rng(1)
        image = (100 + 20 * rng.random((64, 64, 1)) * np.ones(3)).astype(np.uint8)
        restored = clahe.restore(image)
        assert restored.std() > 1.3 * image.std()

    def test_keeps_the_colours_of_lab(self):
        """a and b survive within the rounding of 8-bit Lab (3 levels); L does not."""
        import cv2

        row, column = np.mgrid[:64, :64]
        image = np.stack([90 + column // 2, 120 + row // 2, 110 + column // 3], axis=2).astype(np.uint8)
        before, after = (
            cv2.cvtColor(picture, cv2.COLOR_RGB2Lab).astype(int) for picture in (image, clahe.restore(image))
        )
        assert np.abs(after - before)[..., 1:].max() <= 3
        assert np.abs(after - before)[..., 0].max() > 8

    def test_is_no_identity_and_no_oracle(self):
        image = np.random.default_rng(2).integers(60, 120, (64, 64, 3), dtype=np.uint8)
        assert psnr(image, clahe.restore(image)) < 40
