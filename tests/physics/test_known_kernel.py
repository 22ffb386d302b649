"""A linear motion along a far flat chart is a convolution with the known kernel, and is none at edges of depth."""

import numpy as np
import pytest

from scripts import motion_kernel
from uwsim.motion_blur import kernels

HEIGHT_PX = 40
MARGIN_PX = 20  # where the periodic convolution brings in the other side of the picture


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def relative_rms(one: np.ndarray, other: np.ndarray, where: np.ndarray) -> float:
    return float(np.sqrt(np.mean((one - other)[where] ** 2) / np.mean(other[where] ** 2)))


@pytest.fixture(scope="module")
def rendered() -> dict[str, dict[str, np.ndarray]]:
    return {
        name: motion_kernel.pictures(motion_kernel.scene(plate=plate, height_px=HEIGHT_PX), samples=192)
        for name, plate in (("chart", False), ("plate", True))
    }


def inner(found: dict[str, np.ndarray]) -> np.ndarray:
    """Return the pixels (H, W) that see the chart all the time, away from the picture's sides."""
    mask = found["instance"] == 1
    mask[:, :MARGIN_PX] = mask[:, -MARGIN_PX:] = False
    return mask


def test_the_chart_s_streak_has_the_length_that_geometry_gives(rendered):
    """Expected: f v T / z along -x, to 0.01 px (flow rounded)."""
    chosen = motion_kernel.scene(plate=False, height_px=HEIGHT_PX)
    expected = chosen.lens.K[0, 0] * motion_kernel.SPEED_M_PER_S * motion_kernel.EXPOSURE_S / motion_kernel.CHART_M
    np.testing.assert_allclose(rendered["chart"]["streak_px"], (-expected, 0.0), atol=0.01)
    assert 5 < expected < 10


def test_on_a_far_flat_chart_motion_is_a_convolution_with_the_known_kernel(rendered):
    """Setup: rig sideways along a chart in parallel light, 6.6 px. Expected: the sharp picture, convolved with the
    exact transfer function, is the blurred one. Tolerance, model: 2 % rms (sharp edges that single pixels do not
    resolve, between them; Monte Carlo). Negative controls: without the kernel, half and one and a half times as long,
    and across the motion, at least 4 times as far off."""
    found = rendered["chart"]
    where = inner(found)
    noise = np.sqrt(np.mean(found["blurred_error"][where] ** 2) / np.mean(found["blurred"][where] ** 2))
    assert noise < 0.0125, f"test has no power: {noise:.3g}"
    off = relative_rms(motion_kernel.convolved(found), found["blurred"], where)
    print(f"rms difference {off:.4f}, of it noise {noise:.4f}")
    assert off < 0.02
    length_px = float(np.linalg.norm(found["streak_px"]))
    for length, angle_deg in ((0.0, 0.0), (length_px / 2, 0.0), (1.5 * length_px, 0.0), (length_px, 90.0)):
        wrong = kernels.blur(found["sharp"], length_px=length, angle_deg=angle_deg)
        assert relative_rms(wrong, found["blurred"], where) > 4 * off


def test_around_an_edge_of_depth_it_is_none(rendered):
    """Setup: the same with a near plate, whose streak is 15 px long. Expected: within a streak of the plate's upright
    edges convolution with the chart's kernel is off by more than 10 % rms, 5 times as much as on the chart far from it.
    Negative control: the same pixels without the plate."""
    found, plain = rendered["plate"], rendered["chart"]
    plate_px = np.linalg.norm(plain["streak_px"]) * motion_kernel.CHART_M / motion_kernel.PLATE_M
    near = found["instance"] == 2
    rows = np.any(near, axis=1)
    columns = np.flatnonzero(np.any(near, axis=0))
    x = np.arange(near.shape[1])
    reach = plate_px / 2
    edges = np.minimum(np.abs(x - columns[0]), np.abs(x - columns[-1] - 1)) < reach
    far = inner(found) & ~((x > columns[0] - 2 * reach) & (x < columns[-1] + 2 * reach))
    at_edges = rows[:, None] & edges
    made = motion_kernel.convolved(found)
    off = relative_rms(made, found["blurred"], at_edges)
    print(f"rms difference at the edges {off:.4f}")
    assert off > 0.1
    assert off > 5 * relative_rms(made, found["blurred"], far)
    assert relative_rms(motion_kernel.convolved(plain), plain["blurred"], at_edges) < 0.03
