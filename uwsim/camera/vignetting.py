"""Vignetting: how much darker the image of an even scene is away from the optical axis."""

import numpy as np


def relative_illumination(
    K: np.ndarray, *, width_px: int, height_px: int, cos4: bool, polynomial: tuple[float, ...] = ()
) -> np.ndarray:
    """Return the illumination at the pixel centres relative to the axis, (H, W) float64.

    cos^4(t) if `cos4`, times 1 + k1 tan^2(t) + k2 tan^4(t) + ... with `polynomial` = (k1, k2, ...); tan(t) is the
    distance from the principal point over the focal length, t the field angle behind a lens without distortion.
    Raises ValueError where the polynomial is not positive.

    Source: the cos^4 law of radiometry (irradiance of a small Lambertian pupil on a plane parallel to it); the
    polynomial in even powers of the radius is the usual form of measured lens profiles.
    """
    rows, columns = np.mgrid[0:height_px, 0:width_px] + 0.5
    plane = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(K).T
    tan2 = plane[..., 0] ** 2 + plane[..., 1] ** 2
    fall = 1 + sum(k * tan2**power for power, k in enumerate(polynomial, start=1))
    if not np.min(fall) > 0:
        raise ValueError(
            f"vignetting: polynomial {list(polynomial)} falls to {np.min(fall):.3g} at "
            f"{np.degrees(np.arctan(np.sqrt(np.max(tan2)))):.1f} degrees, allowed: > 0 in the whole image"
        )
    # cos^4 = 1 / (1 + tan^2)^2
    return fall / (1 + tan2) ** 2 if cos4 else fall * np.ones_like(tan2)
