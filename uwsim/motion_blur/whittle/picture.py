"""From a grey picture to the estimate: search, fit, and what the fit is worth."""

from dataclasses import dataclass

import numpy as np

from uwsim.motion_blur.estimate import Estimate, longest_length_px
from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.fit import Fit, refine
from uwsim.motion_blur.whittle.gate import BLUR_NATS, blur_nats
from uwsim.motion_blur.whittle.model import RIGHT, UP
from uwsim.motion_blur.whittle.periodogram import Frequencies, frequencies
from uwsim.motion_blur.whittle.search import LOOSE, UNIFORM, candidates

# valleys fitted on all frequencies; the best of them is the answer
CANDIDATES = 3
# standard deviations of real pictures over those of the model: their textures are no power laws
REAL_OVER_MODEL_STD = 2.7
# shorter ones cannot be told from a lens
SHORTEST_PX = 1.5
# nats per informative frequency that a static share and filled zeros explain in a picture that does not move as one
_NOT_UNIFORM_NATS = 0.03
_TINY = 1e-12


@dataclass(frozen=True)
class Found:
    """The fit of one picture, with what is needed to read it."""

    fit: Fit
    frequencies: Frequencies
    scale: float
    verdict: str

    @property
    def displacement_px(self) -> np.ndarray:
        """(2,): to the right and up, up >= 0: the sign cannot be seen."""
        displacement = self.fit.parameters[[RIGHT, UP]]
        return -displacement if displacement[1] < 0 else displacement

    @property
    def covariance_px2(self) -> np.ndarray:
        """(2, 2) of the displacement to the right and up [px^2]."""
        information = self.fit.information + np.diag(self.fit.precision)
        scale = 1 / np.sqrt(np.maximum(np.diag(information), _TINY))
        inverse = np.linalg.pinv(information * np.outer(scale, scale), hermitian=True) * np.outer(scale, scale)
        return inverse[:2, :2] * self.frequencies.inflation * REAL_OVER_MODEL_STD**2

    def estimate(self) -> Estimate:
        """Return length, angle and all that is known of them."""
        right, up = self.displacement_px
        length = float(np.hypot(right, up))
        angle = float(np.arctan2(up, right))
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        slopes = np.stack([along, np.degrees(across / max(length, _TINY))])
        angle_deg = np.degrees(angle) % 180.0
        return Estimate(
            length_px=length, angle_deg=0.0 if angle_deg >= 180.0 else float(angle_deg),
            covariance=slopes @ self.covariance_px2 @ slopes.T, verdict=self.verdict,
            spectrum=model.spectrum(
                self.fit.parameters, scale=self.scale, lowest_frequency=self.frequencies.lowest_frequency
            ),
        )  # fmt: skip


def find(grey: np.ndarray, *, lens_std_px: float = 0.0, hints_px: np.ndarray | None = None) -> Found | None:
    """Return the fit of a grey picture (H, W) that is finite and not constant; None if its inner part is constant.

    `hints_px` (n, 2): displacements (right, up) to start from, besides the search's own.
    """
    found = frequencies(*grey.shape)
    scale = float(grey.std())
    power = found.periodogram(grey / scale).astype(np.float32)
    if float(power[found.fitted].max()) < _TINY:
        return None
    limit_px = longest_length_px(grey.shape)
    hints_px = np.empty((0, 2)) if hints_px is None else np.asarray(hints_px, float)
    options = {"limit_px": limit_px, "count": CANDIDATES, "hints_px": hints_px}
    prior = model.prior(lens_std_px=lens_std_px)
    loose_prior = model.prior(lens_std_px=lens_std_px, uniform=False)
    uniform = candidates(found, power, UNIFORM, prior=prior, **options)
    loose = candidates(found, power, LOOSE, prior=loose_prior, **options)
    is_uniform = uniform.loss - loose.loss < _NOT_UNIFORM_NATS * loose.informative
    starts, prior = (uniform, prior) if is_uniform else (loose, loose_prior)
    fits = [refine(found, power, start, limit_px=limit_px, prior=prior) for start in starts.parameters]
    best = min(fits, key=lambda fit: fit.loss)
    length_px = float(np.hypot(best.parameters[RIGHT], best.parameters[UP]))
    verdict = "blur" if is_uniform else "not uniform"
    if length_px < SHORTEST_PX or blur_nats(found, power, best.parameters, lens_std_px=lens_std_px) < BLUR_NATS:
        verdict = "no blur"
    return Found(best, found, scale, verdict)
