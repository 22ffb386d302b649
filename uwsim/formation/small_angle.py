"""Light scattered by small angles on a path: point-spread function and modulation of eq. 2.33, and an image's blur.

Angles are those seen from the end of the path (camera or lamp); omega is an angular frequency in 1/rad, so that the
width B R of the spread light is an angle.
"""

from functools import cache

import numpy as np
from scipy import fft, special

from uwsim.optics.checks import require
from uwsim.optics.phase import PhaseMixture
from uwsim.optics.water import Water

VIEW_ANGLE_RAD = np.radians(30.0)
"""Scattering by less keeps light on its way to the camera: about the half angle of a view, beyond which light comes
from what the picture does not show; up to here an angle and its tangent are one within 10 %. [rad]"""

HEMISPHERE_RAD = np.pi / 2
"""Scattering by less keeps light on its way to a surface or a volume, which receive from all sides. [rad]"""

_STEP = 1.25  # ratio of the widths of neighbouring slabs: e^(-width omega) between two is met within 0.4 % of 1
_NARROW_PX = 1e-3  # widths below this leave an image as it is


def modulation(
    omega_per_rad: np.ndarray, range_m: np.ndarray, *, damping_rad_per_m: np.ndarray, loss_per_m: np.ndarray,
    attenuation_per_m: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the modulation transfer of the scattered part, (e^(-G R) - e^(-c R)) e^(-B R omega), arrays broadcast.

    Together with e^(-c R) of the unscattered part it is e^(-G R) at omega = 0: what a uniform scene loses.
    Raises ValueError unless 0 <= G <= c and B >= 0.
    Source: dissertation eq. 2.33 and 2.54; McGlamery 1980, Proc. SPIE 208:221; Jaffe 1990, IEEE J. Ocean. Eng. 15:101.
    Valid: angles small enough for sin = tan = angle; object and camera in the same water.
    Errata: omega must be in 1/rad for B R omega to have no unit; 2.54 prints e^(+c R).
    """
    omega = require("omega_per_rad", omega_per_rad, least=0)
    share = scattered_share(range_m, loss_per_m=loss_per_m, attenuation_per_m=attenuation_per_m)
    damping = require("damping_rad_per_m (B)", damping_rad_per_m, least=0)
    return share * np.exp(-damping * np.asarray(range_m, float) * omega)


def scattered_share(range_m: np.ndarray, *, loss_per_m: np.ndarray, attenuation_per_m: np.ndarray) -> np.ndarray:
    """Return e^(-G R) - e^(-c R), the share of the light that arrives scattered; 0 at infinite range.

    Raises ValueError unless 0 <= G <= c.
    """
    path = np.asarray(range_m, float)
    if np.any(np.isnan(path) | (path < 0)):
        raise ValueError(f"small angle: range_m has a minimum of {np.min(path):g}, allowed: >= 0, infinite included")
    c = require("small angle: attenuation_per_m (c)", attenuation_per_m, least=0)
    g = require("small angle: loss_per_m (G)", loss_per_m, least=0)
    if np.any(g > c * (1 + 1e-9)):
        raise ValueError(f"small angle: loss_per_m (G) reaches {np.max(g):g}, allowed: 0 to c = {np.max(c):g} [1/m]")
    known = np.where(np.isfinite(path), path, 0.0)
    # one factor of the two, so that nothing is lost where they are nearly equal
    share = np.exp(-g * known) * -np.expm1(-np.maximum(c - g, 0) * known)
    return np.where(np.isfinite(path), share, 0.0)


def psf(
    angle_rad: np.ndarray, range_m: np.ndarray, *, damping_rad_per_m: np.ndarray, loss_per_m: np.ndarray,
    attenuation_per_m: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the point-spread function of the scattered part, w = B R: share w / (2 pi (w^2 + angle^2)^1.5). [1/sr]

    It is the transform of `modulation`; its integral over the plane of angles is the share e^(-G R) - e^(-c R), of
    which `encircled` is within an angle. Raises ValueError as `modulation`, and for a width of 0.
    Source: inverse Hankel transform of eq. 2.33.
    """
    angle = require("angle_rad", angle_rad, least=0)
    width = require("point-spread width B R", np.asarray(damping_rad_per_m) * np.asarray(range_m, float), above=0)
    share = scattered_share(range_m, loss_per_m=loss_per_m, attenuation_per_m=attenuation_per_m)
    return share * width / (2 * np.pi * (width**2 + angle**2) ** 1.5)


def encircled(angle_rad: np.ndarray, *, width_rad: np.ndarray) -> np.ndarray:
    """Return the share of the scattered part that arrives within an angle, 1 - w / sqrt(w^2 + angle^2), w = B R."""
    angle, width = require("angle_rad", angle_rad, least=0), require("width_rad", width_rad, above=0)
    return 1 - width / np.hypot(width, angle)


def forward_share(phase: PhaseMixture, *, forward_angle_rad: float = VIEW_ANGLE_RAD) -> np.ndarray:
    """Return the share scattered by less than `forward_angle_rad` at every wavelength, (61,)."""
    limit = require("forward_angle_rad", forward_angle_rad, above=0, most=np.pi)
    return np.array([float(term.cdf(np.asarray(limit))) for term in phase.terms]) @ phase.weights


def loss_per_m(water: Water, *, forward_angle_rad: float = VIEW_ANGLE_RAD) -> np.ndarray:
    """Return G = a + b (share scattered by more than `forward_angle_rad`), (61,), between a and c. [1/m]

    With `HEMISPHERE_RAD` a + b_b: light leaves by absorption and backwards only.
    Source: energy balance of eq. 2.33 at omega = 0, e^(-c R) + (e^(-G R) - e^(-c R)) = e^(-G R), of a uniform scene.
    Valid: a view about as wide as VIEW_ANGLE_RAD; a smaller angle counts too little light as scattered forwards, a
    larger one too much. `uwsim bench validity` measures what is left.
    Errata: the dissertation calls G empirical, with |G| < |c|.
    """
    return water.absorption + water.scattering * (1 - forward_share(water.phase, forward_angle_rad=forward_angle_rad))


def damping_rad_per_m(
    range_m: np.ndarray, *, water: Water, weights: np.ndarray, forward_angle_rad: float = VIEW_ANGLE_RAD,
) -> np.ndarray:  # fmt: skip
    """Return B that follows from the phase function at paths of any shape; the value at 1 m where infinite. [rad/m]

    Light scattered by an angle at a distance s along the path is seen t = s / R times that angle off (s from the other
    end), so that small angles add up to the modulation (Wells)

        exp(-c R + F b R I(omega)),   I(omega) = mean over t in 0..1 of P(t omega),

    where P is the Hankel transform of the part of the phase function below `forward_angle_rad` and F its share. Less
    the unscattered e^(-c R), relative to its value at 0, this falls to 1/e at omega = 1 / (B R), which defines B.
    weights (61,): how much each wavelength counts; one B for all of them. With little scattering B R tends to a
    constant (the angle of one scattering, on average half way); with much, B does.
    Source: Wells 1973, AGARD Lecture Series 61, ch. 4.3, matched to eq. 2.33 where both are 1/e.
    Valid: the true modulation has a narrower and a wider part than this single exponential: transport has more contrast
    in the finest detail (`contrast_error` of `uwsim bench validity`).
    Errata: the dissertation's "typically approximated as c" has the unit of B only by the accident of radians.
    """
    path = np.asarray(range_m, float)
    known = np.where(np.isfinite(path), path, 1.0)
    share, scattering = _mean_water(water, weights, forward_angle_rad)
    if scattering == 0 or known.size == 0:
        return np.zeros(path.shape)
    low, high = max(known.min(), 1e-6), max(known.max(), 1e-6)
    nodes = np.geomspace(low, high * (1 + 1e-12), 2 if high / low < 1.0001 else 64)
    omega, mean = _mean_transform(water.phase, tuple(share), float(forward_angle_rad))
    width = np.array([_e_folding(scattering * node, omega, mean) for node in nodes])
    # the width changes little with range where B = width / range does
    return np.interp(np.log(np.maximum(known, 1e-6)), np.log(nodes), width) / np.maximum(known, 1e-6)


def _mean_water(water: Water, weights: np.ndarray, forward_angle_rad: float) -> tuple[np.ndarray, float]:
    """Return the mean shares of the phase function's terms and the mean forward scattering coefficient [1/m]."""
    weights = require("small angle: weights of the wavelengths", weights, least=0)
    total = np.sum(weights * water.scattering)
    if total == 0:
        return np.full(len(water.phase.terms), 1 / len(water.phase.terms)), 0.0
    share = water.phase.weights @ (weights * water.scattering) / total
    forward = forward_share(water.phase, forward_angle_rad=forward_angle_rad) * water.scattering
    return np.round(share, 9), float(np.sum(weights * forward) / np.sum(weights))


_OMEGA = np.concatenate([[0.0], np.geomspace(3e-2, 1e6, 320)])


@cache
def _term_transform(term, forward_angle_rad: float) -> tuple[float, np.ndarray]:
    """Return a term's share below the angle, and share x Hankel transform on _OMEGA."""
    edges = np.geomspace(1e-8, forward_angle_rad, 3000)
    below = np.asarray(term.cdf(edges))
    middle, ring = np.sqrt(edges[1:] * edges[:-1]), np.diff(below)
    transform = np.array([ring @ special.j0(omega * middle) for omega in _OMEGA])
    return float(below[-1]), transform + below[0]


def _mean_transform(phase: PhaseMixture, share: tuple, forward_angle_rad: float) -> tuple[np.ndarray, np.ndarray]:
    """Return omega (n,) and I(omega) (n,), relative to 1 at omega = 0."""
    parts = [_term_transform(term, forward_angle_rad) for term in phase.terms]
    total = sum(weight * part[0] for weight, part in zip(share, parts, strict=True))
    transform = sum(weight * part[1] for weight, part in zip(share, parts, strict=True)) / total
    steps = 0.5 * (transform[1:] + transform[:-1]) * np.diff(_OMEGA)
    mean = np.concatenate([[1.0], np.cumsum(steps) / _OMEGA[1:]])
    return _OMEGA, mean


def _e_folding(optical: float, omega: np.ndarray, mean: np.ndarray) -> float:
    """Return the width 1 / omega at which the scattered modulation after an optical path is 1/e of that at 0."""
    relative = np.exp(optical * (mean - 1)) * -np.expm1(-optical * mean) / -np.expm1(-optical)
    last = int(np.argmax(relative < np.exp(-1)))
    if last == 0:  # more than 1/e of the light is scattered by less than a microradian
        return float(1 / omega[-1])
    at = np.interp(-np.exp(-1), -relative[last - 1 : last + 1], np.log(np.maximum(omega[last - 1 : last + 1], 1e-3)))
    return float(np.exp(-at))


def blur(
    image: np.ndarray, range_m: np.ndarray, pixel_angle_rad: float, *, damping_rad_per_m: np.ndarray,
    loss_per_m: np.ndarray | None = None, attenuation_per_m: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """Return the scattered part of an image, the light of each pixel spread by its own width B R, (H, W, C) float32.

    image (H, W, C) without attenuation; range_m (H, W); B a number or (H, W); G and c numbers or (C,), both or none:
    without them each pixel's light is spread as it is (modulation e^(-B R omega) only), for images to which the share
    e^(-G R) - e^(-c R) was applied wavelength by wavelength. Where the range is infinite the image must be 0 unless G
    and c are given.
    Light is neither lost nor wrapped at the edges: the image goes on mirrored beyond them (cosine transform). Pixels
    are grouped by width into slabs 25 % apart, those in between shared by the two slabs next to them in proportion.
    Raises ValueError for shapes that do not fit, and a width that is not finite where there is light.
    Valid: pixels of the same angle everywhere (of a lens of 50 degrees, those at the edge are 20 % smaller).
    """
    picture = _checked_image(image, range_m)
    angle = require("pixel_angle_rad", pixel_angle_rad, above=0)
    if (loss_per_m is None) != (attenuation_per_m is None):
        raise ValueError("blur: got one of loss_per_m (G) and attenuation_per_m (c), allowed: both or none")
    path = np.asarray(range_m, np.float64)
    if loss_per_m is not None:
        share = scattered_share(path[..., None], loss_per_m=loss_per_m, attenuation_per_m=attenuation_per_m)
        picture = picture * share.astype(np.float32)
    lit = np.any(picture != 0, axis=2)
    finite = np.isfinite(path)
    damping = require("blur: damping_rad_per_m (B)", damping_rad_per_m, least=0)
    width = damping * np.where(finite, path, 0.0) / angle
    if np.any(lit & ~finite):
        raise ValueError("blur: got light at an infinite range, allowed: none unless G and c are given")
    return _spread(picture, width, lit)


def _checked_image(image: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    picture = np.asarray(image, np.float32)
    if picture.ndim != 3 or np.shape(range_m) != picture.shape[:2]:
        raise ValueError(
            f"blur: image has shape {picture.shape}, range_m {np.shape(range_m)}, allowed: (H, W, C) and (H, W)"
        )
    if not np.all(np.isfinite(picture)):
        raise ValueError("blur: image is not finite everywhere")
    return picture


def radial_frequency(shape: tuple[int, int]) -> np.ndarray:
    """Return omega of the terms of the cosine transform of an image, (H, W) float32. [1/pixel]"""
    rows, columns = (np.pi * np.arange(count, dtype=np.float32) / count for count in shape)
    return np.hypot(rows[:, None], columns[None, :])


def _spread(picture: np.ndarray, width_px: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """Return an image with the light of each pixel spread by its own width; slabs are summed before one transform."""
    if not lit.any():
        return np.zeros_like(picture)
    width = np.maximum(width_px, _NARROW_PX)
    low, high = float(width[lit].min()), float(width[lit].max())
    count = 1 + int(np.ceil(np.log(high / low) / np.log(_STEP) - 1e-9))
    place = np.clip(np.log(width / low) / np.log(_STEP), 0, count - 1).astype(np.float32)
    omega = radial_frequency(picture.shape[:2])
    total = np.zeros_like(picture)
    for slab in range(count):
        weight = np.maximum(1 - np.abs(place - slab), 0)
        if not np.any(weight[lit]):
            continue
        terms = fft.dctn(picture * weight[..., None], axes=(0, 1), norm="ortho", overwrite_x=True)
        total += terms * np.exp(-np.float32(low * _STEP**slab) * omega)[..., None]
    return fft.idctn(total, axes=(0, 1), norm="ortho", overwrite_x=True)
