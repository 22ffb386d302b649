"""Detail with the usual contrast, where the model does not know how much of it the water left."""

import numpy as np

from uwsim.restoration.local_contrast import with_usual_contrast

SHAPE = (120, 160, 3)
BEHIND = np.full(SHAPE, 0.5, np.float32)


def seen(contrast: float, noise_std: float = 0.0) -> np.ndarray:
    """A chequerboard of fields of 3 pixels about 0.3, and noise."""
    rows, columns = np.mgrid[:120, :160]
    board = 0.3 + contrast * np.where((rows // 3 + columns // 3) % 2, 1.0, -1.0)
    noise = np.random.default_rng(0).standard_normal(SHAPE)
    return (board[..., None] + noise_std * noise).astype(np.float32)


def shown(picture: np.ndarray, variance: float, behind: np.ndarray = BEHIND) -> np.ndarray:
    return with_usual_contrast(behind, picture, np.full(SHAPE, variance))


def test_contrast_does_not_depend_on_what_the_water_left_of_it():
    strong, weak = (shown(seen(contrast), 1e-12) for contrast in (0.2, 0.002))
    np.testing.assert_allclose(weak, strong, atol=0.01)
    assert abs(strong[20:-20, 20:-20].std() - 0.25) < 0.01
    # control: the pictures themselves differ a hundredfold
    assert seen(0.2).std() > 90 * seen(0.002).std()


def test_noise_is_not_shown_as_detail():
    behind = np.random.default_rng(1).uniform(0.2, 0.8, (8, 10)).repeat(15, axis=0).repeat(16, axis=1)
    behind = np.repeat(behind[..., None], 3, axis=2).astype(np.float32)
    # of a denoised picture a tenth of the variance is left
    picture = seen(0.0, noise_std=0.1**0.5 * 0.02)
    assert np.abs(shown(picture, 0.02**2, behind) - behind).mean() < 0.05
    # control: called certain, it is detail
    assert np.abs(shown(picture, 1e-12, behind) - behind).mean() > 0.15


def test_half_of_what_is_behind_where_detail_equals_noise():
    """Power of the detail 0.85^2 times the noise of the grey picture: half is shown, of 0.25 / sqrt(2)."""
    contrast = 0.01
    found = shown(seen(contrast), 3 * (contrast / 0.85) ** 2, np.full(SHAPE, 0.4, np.float32))[20:-20, 20:-20]
    assert abs(found.std() - 0.5 * 0.25 / 2**0.5) < 0.005
    assert abs(found.mean() - 0.4) < 0.01


def test_room_is_made_for_detail_on_white_but_not_without_detail():
    white = np.full(SHAPE, 0.98, np.float32)
    assert abs(shown(seen(0.1), 1e-12, white)[20:-20, 20:-20].mean() - 0.7) < 0.01
    np.testing.assert_allclose(shown(seen(0.0), 1e-4, white), white, atol=1e-3)
