"""The Cramer-Rao bound: how well length and angle of a blur can be known from the power spectrum of one frame.

Sound for a stationary Gaussian texture, uniform straight motion and white noise, with texture and noise unknown. It
bounds methods that read the power spectrum; edges could in principle tell more through their phase.

Source: Whittle, Arkiv foer Matematik 2, 1953 (likelihood); Porat, Digital Processing of Random Signals, 1994, section
2.10 (information of a spectrum).
Valid: many frequencies per stripe, sqrt(H W) >> length; lengths whose roll-off can be told from that of the texture,
about 1 px and more.
"""

import numpy as np

from uwsim.motion_blur.estimate import grey_from_image
from uwsim.motion_blur.spectrum import Spectrum, texture_terms
from uwsim.motion_blur.whittle import fit, model
from uwsim.motion_blur.whittle.periodogram import frequencies


def bound(
    sharp: np.ndarray | Spectrum, *, noise_std: float, length_px: float, angle_deg: float,
    shape: tuple[int, int] | None = None,
) -> np.ndarray:  # fmt: skip
    """Return the least covariance (2, 2) of (length_px, angle_deg) of any unbiased estimate: px^2, px deg, deg^2.

    `sharp`: the frame without blur, linear, (H, W[, C]), or what `spectrum_of_sharp` found of it; then `shape` (H, W)
    of the blurred frame is needed. `noise_std`: of all noise of the grey frame, in its units (8 bits add 1 / (255
    sqrt(12)) in quadrature). ValueError on a length that is not positive or a noise_std that is not.
    """
    if not (np.isfinite(length_px) and length_px > 0 and np.isfinite(angle_deg)):
        raise ValueError(f"bound: got length {length_px} px, angle {angle_deg} deg, allowed: finite, length > 0")
    if not (np.isfinite(noise_std) and noise_std > 0):
        raise ValueError(f"bound: got noise_std {noise_std}, allowed: finite, > 0")
    if not isinstance(sharp, Spectrum):
        shape = np.shape(sharp)[:2] if shape is None else shape
        sharp = spectrum_of_sharp(sharp)
    if shape is None:
        raise ValueError("bound: got a Spectrum without shape, allowed: with the (H, W) of the frame")
    height, width = shape
    u, v = np.meshgrid(np.fft.rfftfreq(width), np.fft.fftfreq(height))
    fitted = frequencies(height, width).fitted
    slopes = _slopes(sharp, u[fitted], v[fitted], noise_std, length_px, np.radians(angle_deg))
    information = slopes.T @ slopes
    # lengths and angles have scales of their own: scaled, the inverse loses no digits
    scale = 1 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    degrees = np.array([1.0, np.degrees(1.0)])
    return covariance[:2, :2] * np.outer(degrees, degrees)


def _slopes(
    spectrum: Spectrum, u: np.ndarray, v: np.ndarray, noise_std: float, length_px: float, angle_rad: float
) -> np.ndarray:
    """Return (n, 17): slopes of the logarithm of the density by length, angle, ln noise and the texture's factors."""
    along = u * np.cos(angle_rad) - v * np.sin(angle_rad)
    across = -u * np.sin(angle_rad) - v * np.cos(angle_rad)
    terms = texture_terms(u, v, lowest_frequency=spectrum.lowest_frequency)
    texture = np.exp(terms @ np.asarray(spectrum.texture))
    moving, slope, _ = model.transfer(length_px * along, 0.0)
    signal = texture * moving
    total = signal + noise_std**2
    by_blur = texture * slope / total
    columns = [by_blur * along, by_blur * length_px * across, noise_std**2 / total]
    return np.concatenate([np.stack(columns, axis=1), (signal / total)[:, None] * terms], axis=1)


def spectrum_of_sharp(sharp: np.ndarray) -> Spectrum:
    """Return texture and noise of a linear frame (H, W[, C]) known to be sharp; ValueError as for every estimator."""
    grey = grey_from_image(sharp, where="spectrum_of_sharp")
    found = frequencies(*grey.shape)
    scale = float(grey.std())
    power = found.periodogram(grey / scale).astype(np.float32)
    prior = model.prior()
    start = prior[0].copy()
    start[[model.STATIC, model.FILL]] = [limits[0] for limits in (model.LIMITS[model.STATIC], model.LIMITS[model.FILL])]
    high = power[found.fitted & (np.hypot(found.u, found.v) > 0.4)]
    start[model.NOISE] = np.log(max(float(np.quantile(high, 0.1)), 1e-12))
    near = found.fitted & (np.abs(np.hypot(found.u, found.v) - 0.1) < 0.02)
    start[model.TEXTURE.start] = np.log(max(float(power[near].mean()), 1e-12))
    free = [model.NOISE, *range(model.TEXTURE.start, model.TEXTURE.stop)]
    best = fit.refine(found, power, start, limit_px=0.0, prior=prior, free=free)
    return model.spectrum(best.parameters, scale=scale, lowest_frequency=found.lowest_frequency)
