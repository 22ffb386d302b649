"""The deepest point of the cepstrum: the zeros of the blur's spectrum repeat with the pitch 1 / length.

log |sinc(L s)|^2 has a cepstrum that lives on the line of the motion and has negative peaks at L, 2 L, ...;
the peak at L is the deepest. Small blurs (under about 3 px) and noise hide it: a number is still returned,
and is then wrong.

Source: Rom, IEEE Trans. Information Theory 21(2), 1975 (cepstrum of motion blur); Gennery, J. Optical Society
of America 63, 1973. Sub-pixel: vertex of the quadratic through the 3 x 3 neighbours.
"""

import numpy as np

from uwsim.motion_blur.estimate import Estimate, estimate_from_vector, grey_from_image, longest_length_px

INPUT = "linear_float32"
NEEDS = ()

SHORTEST_PX = 1.5
# floor of the power spectrum before the logarithm, as a share of its mean
_POWER_FLOOR = 1e-12


def estimate(image: np.ndarray) -> Estimate:
    """Return the blur of a linear image (H, W, 3); a number always, also where there is no blur.

    Searches lengths from 1.5 px to 40 px (less than half a side of small images). ValueError for images that
    are constant, not finite or under 16 px.
    """
    grey = grey_from_image(image, where="cepstrum_minimum")
    values = cepstrum(grey)
    rows, columns = (np.rint(np.fft.fftfreq(side) * side) for side in grey.shape)
    distance = np.hypot(rows[:, None], columns[None, :])
    searched = (distance >= SHORTEST_PX) & (distance <= longest_length_px(grey.shape))
    # the cepstrum of a real image is even: the half above, where rows are negative, is enough
    searched &= (rows[:, None] < 0) | ((rows[:, None] == 0) & (columns[None, :] > 0))
    row, column = np.unravel_index(np.argmin(np.where(searched, values, np.inf)), values.shape)
    shift_down, shift_right = _vertex(values, row, column)
    return estimate_from_vector(columns[column] + shift_right, -(rows[row] + shift_down))


def cepstrum(grey: np.ndarray) -> np.ndarray:
    """Return the cepstrum (H, W) of the Hann-windowed image, from its power spectrum; quefrency 0 first."""
    window = np.hanning(grey.shape[0])[:, None] * np.hanning(grey.shape[1])[None, :]
    centred = grey - (window * grey).sum() / window.sum()
    power = np.abs(np.fft.fft2(window * centred)) ** 2
    floor = max(_POWER_FLOOR * power.mean(), np.finfo(float).tiny)
    return np.fft.ifft2(np.log(power + floor)).real


def _vertex(values: np.ndarray, row: int, column: int) -> tuple[float, float]:
    """Return the minimum (down, right), within one pixel, of the quadratic fitted to 3 x 3 values."""
    height, width = values.shape
    near = values[np.ix_([(row + i) % height for i in (-1, 0, 1)], [(column + j) % width for j in (-1, 0, 1)])]
    down = (near[2] - near[0]).mean() / 2
    right = (near[:, 2] - near[:, 0]).mean() / 2
    down_down = (near[0] - 2 * near[1] + near[2]).mean()
    right_right = (near[:, 0] - 2 * near[:, 1] + near[:, 2]).mean()
    down_right = (near[2, 2] - near[2, 0] - near[0, 2] + near[0, 0]) / 4
    determinant = down_down * right_right - down_right**2
    if determinant <= 0 or down_down <= 0:
        return 0.0, 0.0
    shift_down = (down_right * right - right_right * down) / determinant
    shift_right = (down_right * down - down_down * right) / determinant
    return float(np.clip(shift_down, -1, 1)), float(np.clip(shift_right, -1, 1))
