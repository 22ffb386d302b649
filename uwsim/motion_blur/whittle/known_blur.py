"""Noise and texture of a picture whose blur is known: what a deconvolution weighs against each other."""

import numpy as np

from uwsim.motion_blur.spectrum import Spectrum
from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.cells_fit import fit_cells
from uwsim.motion_blur.whittle.fit import CLIP
from uwsim.motion_blur.whittle.model import FILL, LIMITS, NOISE, STATIC, TEXTURE
from uwsim.motion_blur.whittle.periodogram import frequencies
from uwsim.motion_blur.whittle.search import first_guess

_STEPS = 25
# noise below this share of the standard deviation is none: less than the rounding of 12 bits
_LEAST_NOISE_SHARE = 1e-4


def spectrum_of_blurred(picture: np.ndarray, *, length_px: float, angle_deg: float) -> Spectrum:
    """Return noise and texture of a picture (H, W), not constant, blurred by a uniform straight motion: this one.

    The fit of `estimators.whittle` on averaged frequencies, with the transfer of the blur, as the taper and the
    averaging leave it, in place of the unknown one. Angle: x right, y up.
    """
    found = frequencies(*picture.shape)
    scale = float(picture.std())
    power = found.periodogram(picture / scale)
    angle = np.radians(angle_deg)
    right, up = length_px * np.cos(angle), length_px * np.sin(angle)
    transfer = found.leak(np.sinc(right * found.u - up * found.v) ** 2)[found.fitted]
    power_of_cells = found.cells.mean(power[found.fitted])
    prior = model.prior()
    start = first_guess(found, power, power_of_cells, np.array([[right, up]]), prior)
    start[:, [STATIC, FILL]] = LIMITS[STATIC][0], LIMITS[FILL][0]
    free = np.array([NOISE, *range(TEXTURE.start, TEXTURE.stop)])
    parameters, _, _ = fit_cells(
        found.cells, power_of_cells, start, free=free, steps=_STEPS, limit_px=np.inf, prior=prior,
        moving=found.cells.mean(transfer), clip=CLIP,
    )  # fmt: skip
    best = parameters[0]
    best[NOISE] = max(best[NOISE], 2 * np.log(_LEAST_NOISE_SHARE))
    # the power law goes on below the frequencies that are fitted: what lies beyond the border hangs on it
    return model.spectrum(best, scale=scale, lowest_frequency=1 / max(picture.shape))
