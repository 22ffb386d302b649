"""The guided filter: closed-form inputs, limits, and the definition written out with loops."""

import numpy as np
import pytest

from uwsim.restoration.guided_filter import guided, guided_enlarged


def textured(*shape, seed=0):
    return np.random.default_rng(seed).random(shape).astype(np.float32)


def literal(guide, source, radius_px, epsilon):
    """Return the filter as defined, window by window; windows mirrored at the border."""
    height, width = source.shape
    guide = guide.reshape(height, width, -1).astype(float)
    pad = 2 * radius_px
    wide = np.pad(guide, ((pad, pad), (pad, pad), (0, 0)), mode="symmetric")
    wide_source = np.pad(source.astype(float), pad, mode="symmetric")
    total, count = np.zeros((height, width)), (2 * radius_px + 1) ** 2
    for row in range(-radius_px, height + radius_px):
        for column in range(-radius_px, width + radius_px):
            rows = slice(row - radius_px + pad, row + radius_px + 1 + pad)
            columns = slice(column - radius_px + pad, column + radius_px + 1 + pad)
            pixels, values = wide[rows, columns].reshape(count, -1), wide_source[rows, columns].ravel()
            covariance = np.cov(pixels.T, bias=True).reshape(pixels.shape[1], -1)
            with_source = (pixels - pixels.mean(axis=0)).T @ (values - values.mean()) / count
            slope = np.linalg.solve(covariance + epsilon * np.eye(len(covariance)), with_source)
            line = guide @ slope + values.mean() - pixels.mean(axis=0) @ slope
            inside = np.zeros((height, width), bool)
            top, left = max(row - radius_px, 0), max(column - radius_px, 0)
            inside[top : max(row + radius_px + 1, 0), left : max(column + radius_px + 1, 0)] = True
            total[inside] += line[inside]
    return total / count


@pytest.mark.parametrize("channels", [(), (3,)])
def test_is_the_definition_written_out(channels):
    guide, source = textured(14, 17, *channels), textured(14, 17, seed=1)
    found = guided(guide, source, radius_px=2, epsilon=1e-2)
    expected = literal(guide, source, 2, 1e-2)
    # round-off of float32 sums
    np.testing.assert_allclose(found, expected, atol=2e-5)
    assert np.abs(found - literal(guide, source, 1, 1e-2)).max() > 0.01, "control: another radius"
    assert np.abs(found - literal(guide, source, 2, 1e-1)).max() > 0.01, "control: another epsilon"


@pytest.mark.parametrize("channels", [(), (3,)])
def test_what_is_linear_in_the_guide_passes_and_the_rest_is_smoothed(channels):
    guide = textured(40, 50, *channels)
    linear = (guide if guide.ndim == 2 else guide @ np.array([0.2, 0.5, -0.3], np.float32)) * 0.6 + 0.1
    np.testing.assert_allclose(guided(guide, linear, radius_px=5, epsilon=1e-8), linear, atol=1e-5)
    foreign = textured(40, 50, seed=9)
    assert guided(guide, foreign, radius_px=5, epsilon=1e-8).std() < 0.35 * foreign.std()


def test_large_epsilon_leaves_the_mean_of_means():
    import cv2

    guide, source = textured(30, 30), textured(30, 30, seed=1)
    mean = source
    for _ in range(2):
        mean = cv2.blur(mean, (7, 7), borderType=cv2.BORDER_REFLECT)
    np.testing.assert_allclose(guided(guide, source, radius_px=3, epsilon=1e6), mean, atol=1e-5)
    assert np.abs(guided(guide, source, radius_px=3, epsilon=1e-3) - mean).max() > 0.05


def test_a_map_of_epsilon_acts_pixel_by_pixel():
    guide, source = textured(40, 80), textured(40, 80, seed=1)
    epsilon = np.full((40, 80), 1e-3, np.float32)
    epsilon[:, 40:] = 10.0
    found = guided(guide, source, radius_px=3, epsilon=epsilon)
    left, right = (guided(guide, source, radius_px=3, epsilon=value) for value in (1e-3, 10.0))
    np.testing.assert_allclose(found[:, :33], left[:, :33], atol=1e-6)
    np.testing.assert_allclose(found[:, 47:], right[:, 47:], atol=1e-6)
    assert np.abs(left - right)[:, 47:].max() > 0.05


def step_and_noise():
    """Return (guide, source): an edge, in the source under noise."""
    guide = np.where(np.arange(160) < 80, 0.2, 0.8) * np.ones((120, 1))
    noisy = guide + 0.1 * np.random.default_rng(3).standard_normal(guide.shape)
    return guide.astype(np.float32), noisy.astype(np.float32)


@pytest.mark.parametrize("subsample", [1, 4])
def test_noise_goes_and_the_edge_stays(subsample):
    guide, noisy = step_and_noise()
    found = guided(guide, noisy, radius_px=12, epsilon=1e-3, subsample=subsample)
    assert np.abs(found - guide).mean() < 0.02
    assert found[:, 79].mean() < 0.25
    assert found[:, 80].mean() > 0.75
    blurred = guided(np.full_like(guide, 0.5), noisy, radius_px=12, epsilon=1e-3, subsample=subsample)
    assert blurred[:, 80].mean() < 0.6, "control: without an edge in the guide it is lost"


def test_a_small_source_comes_back_with_the_edges_of_the_large_guide():
    import cv2

    guide, _ = step_and_noise()
    small_guide = cv2.resize(guide, (40, 30), interpolation=cv2.INTER_AREA)
    found = guided_enlarged(guide, small_guide, 1 - small_guide, radius_px=4, epsilon=1e-5)
    np.testing.assert_allclose(found, 1 - guide, atol=0.05)
    plain = cv2.resize(1 - small_guide, (160, 120), interpolation=cv2.INTER_LINEAR)
    assert np.abs(plain - (1 - guide)).max() > 0.15, "control: enlarging alone blurs the edge"


GREY, COLOUR = textured(8, 9), textured(8, 9, 3)
WRONG = {
    "source": (GREY, GREY[:4], {}),
    "guide": (COLOUR[..., :2], GREY, {}),
    "float32": (GREY, GREY.astype(float), {}),
    "not finite": (GREY, np.where(GREY > 0.5, np.nan, GREY), {}),
    "radius_px": (GREY, GREY, {"radius_px": 0}),
    "subsample": (GREY, GREY, {"subsample": 1.5}),
    "epsilon": (GREY, GREY, {"epsilon": 0.0}),
    "with a grey guide": (COLOUR, GREY, {"epsilon": np.ones((8, 9))}),
}


@pytest.mark.parametrize("problem", WRONG)
def test_refuses(problem):
    guide, source, keywords = WRONG[problem]
    with pytest.raises(ValueError, match=problem):
        guided(guide, source, **{"radius_px": 2, "epsilon": 1e-3} | keywords)
