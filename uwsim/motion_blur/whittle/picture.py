"""From a grey picture to the estimate: search, fit, and what the fit is worth."""

from dataclasses import dataclass, replace

import numpy as np

from uwsim.motion_blur.estimate import Estimate, longest_length_px
from uwsim.motion_blur.whittle import model
from uwsim.motion_blur.whittle.fit import Fit, refine
from uwsim.motion_blur.whittle.gate import LENS_AND_RIDGE_PX, blur_nats, is_of_squares, least_nats, shows_in_parts
from uwsim.motion_blur.whittle.model import FILL, RIGHT, UP
from uwsim.motion_blur.whittle.periodogram import Frequencies, frequencies
from uwsim.motion_blur.whittle.search import LOOSE, UNIFORM, candidates

# valleys fitted on all frequencies; the best of them is the answer
CANDIDATES = 3
# standard deviations of real pictures over those of the model: their textures are no power laws
REAL_OVER_MODEL_STD = 2.4
# shorter ones cannot be told from a lens
SHORTEST_PX = 1.5
# nats per informative frequency that a static share and filled zeros explain in a picture that does not move as one
_NOT_UNIFORM_NATS = 0.03
# a fit of such a motion that lies further off than this share of its length from a uniform one that sees a blur is one
# of the texture's lines
_AGREE_SHARE = 0.25
_SEES_PX = 1.75
# a motion that is not uniform must still show: its length to this share, and more of a blur than of a ridge, the filled
# zeros' form; lengths at the limit of the search are none
_SEEN_LENGTH_SHARE = 1 / 34
_MOST_FILL = 1.0
_AT_LIMIT = 0.99
_TINY = 1e-12


@dataclass(frozen=True)
class Found:
    """The fit of one picture, with what is needed to read it."""

    fit: Fit
    frequencies: Frequencies
    scale: float
    verdict: str
    is_of_squares: bool = False
    """What looks like a blur is the size of the texture's squares."""

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

    @property
    def length_px(self) -> float:
        return float(np.hypot(*self.displacement_px))

    @property
    def angle_rad(self) -> float:
        right, up = self.displacement_px
        return float(np.arctan2(up, right))

    @property
    def covariance(self) -> np.ndarray:
        """(2, 2) of length [px] and angle [deg]."""
        cos, sin = np.cos(self.angle_rad), np.sin(self.angle_rad)
        along, across = np.array([cos, sin]), np.array([-sin, cos])
        slopes = np.stack([along, np.degrees(across / max(self.length_px, _TINY))])
        return slopes @ self.covariance_px2 @ slopes.T

    def estimate(self) -> Estimate:
        """Return length, angle and all that is known of them."""
        angle_deg = np.degrees(self.angle_rad) % 180.0
        return Estimate(
            length_px=self.length_px, angle_deg=0.0 if angle_deg >= 180.0 else float(angle_deg),
            covariance=self.covariance, verdict=self.verdict,
            spectrum=model.spectrum(
                self.fit.parameters, scale=self.scale, lowest_frequency=self.frequencies.lowest_frequency
            ),
        )  # fmt: skip


def find(grey: np.ndarray, *, lens_std_px: float | None = None, hints_px: np.ndarray | None = None) -> Found | None:
    """Return the fit of a grey picture (H, W) that is finite and not constant; None if its inner part is constant.

    `hints_px` (n, 2): displacements (right, up) to start from, besides the search's own.
    """
    found = frequencies(*grey.shape)
    scale = float(grey.std())
    power = found.power(grey / scale)
    if power is None:
        return None
    limit_px = longest_length_px(grey.shape)
    hints_px = np.empty((0, 2)) if hints_px is None else np.asarray(hints_px, float)
    options = {"limit_px": limit_px, "count": CANDIDATES, "hints_px": hints_px}
    prior = model.prior(lens_std_px=lens_std_px)
    loose_prior = model.prior(lens_std_px=lens_std_px, uniform=False)
    uniform = candidates(found, power, UNIFORM, prior=prior, **options)
    loose = candidates(found, power, LOOSE, prior=loose_prior, **options)
    is_uniform = uniform.loss - loose.loss < _NOT_UNIFORM_NATS * loose.informative or _contradicts(
        loose.parameters[0, [RIGHT, UP]], uniform.parameters[0, [RIGHT, UP]]
    )
    starts, prior = (uniform, prior) if is_uniform else (loose, loose_prior)
    fits = [refine(found, power, start, limit_px=limit_px, prior=prior) for start in starts.parameters]
    best = min(fits, key=lambda fit: fit.loss)
    made = Found(best, found, scale, "blur" if is_uniform else "not uniform")
    shows = made.length_px >= SHORTEST_PX and (is_uniform or _shows(made, limit_px))
    nats = blur_nats(found, power, best.parameters, lens_std_px=lens_std_px) if shows else -np.inf
    if nats < least_nats(made.length_px):
        return replace(made, verdict="no blur")
    is_long = made.length_px >= LENS_AND_RIDGE_PX
    if is_long and is_of_squares(
        grey, found, power, best.parameters, nats=nats, scale=scale, lens_std_px=lens_std_px
    ):  # fmt: skip
        return replace(made, verdict="no blur", is_of_squares=True)
    # hardly anything else looks like a long uniform motion, whose stripes are too fine for a quarter of the picture
    if is_uniform and is_long:
        return made
    is_shown = shows_in_parts(grey, scale=scale, parameters=best.parameters, lens_std_px=lens_std_px)
    return made if is_shown else replace(made, verdict="no blur")


def _contradicts(loose_px: np.ndarray, uniform_px: np.ndarray) -> bool:
    """Return whether two displacements (2,) are different motions, where the uniform one is a blur."""
    apart = min(np.linalg.norm(loose_px - uniform_px), np.linalg.norm(loose_px + uniform_px))
    return np.linalg.norm(uniform_px) >= _SEES_PX and apart > _AGREE_SHARE * np.linalg.norm(loose_px)


def _shows(made: Found, limit_px: float) -> bool:
    """Return whether a fit of a motion that is not uniform is more than one of strong lines of the texture."""
    length_sd_px, fill = float(np.sqrt(made.covariance[0, 0])), float(np.exp(made.fit.parameters[FILL]))
    is_seen = length_sd_px <= _SEEN_LENGTH_SHARE * made.length_px
    return is_seen and fill <= _MOST_FILL and made.length_px < _AT_LIMIT * limit_px
