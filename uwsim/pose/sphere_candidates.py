"""Where a picture may show bright spheres: blobs in scale space, the light scattered into the camera taken off."""

from typing import NamedTuple

import numpy as np

SCALES = 1.25
"""Ratio of neighbouring radii that are looked for."""
_BACKGROUND_RADII = 1.6
_NOISE_LEVELS = 6.0
"""Responses below so many standard deviations of the noise are none."""
_LEAST_SHARE = 0.05
"""And below this share of the strongest."""
_MOST = 100
_MAD_TO_SD = 1.4826
# disc of radius r at the scale r / sqrt 2 that answers most to it: contrast by response
_CONTRAST = np.e / 2
_MARGIN = 1.3
_APART = 1.2


class Candidate(NamedTuple):
    """Centre (2,) [px, centres at integer + 0.5], radius [px] and contrast of a blob, in units of the picture."""

    centre_px: np.ndarray
    radius_px: float
    contrast: float


def without_veil(grey: np.ndarray, *, most_px: float) -> np.ndarray:
    """Return a linear picture (H, W) less what varies slowly in it: light scattered by the water, a lit ground.

    The background is the smoothed picture with everything bright and narrower than a disc of radius 1.6 `most_px`
    taken off. Source: Serra, Image Analysis and Mathematical Morphology, 1982 (opening, top hat).
    """
    import cv2

    picture = np.ascontiguousarray(grey, dtype=np.float32)
    reach = int(np.ceil(_BACKGROUND_RADII * most_px))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    smooth = cv2.GaussianBlur(picture, (0, 0), 1.0, borderType=cv2.BORDER_REFLECT)
    opened = cv2.morphologyEx(smooth, cv2.MORPH_OPEN, disc, borderType=cv2.BORDER_REFLECT)
    return picture - cv2.GaussianBlur(opened, (0, 0), reach / 2, borderType=cv2.BORDER_REFLECT)


def candidates(grey: np.ndarray, *, radius_px: tuple[float, float]) -> list[Candidate]:
    """Return bright blobs of a linear picture (H, W) with radii in about that range [px], strongest first.

    Source: Lindeberg, IJCV 30(2), 1998: maxima over place and scale of the normalised Laplacian of Gaussians.
    """
    import cv2

    least, most = radius_px
    picture = without_veil(grey, most_px=most)
    count = 1 + int(np.ceil(np.log(max(most / least, SCALES) * _MARGIN**2) / np.log(SCALES)))
    radii = least / _MARGIN * SCALES ** np.arange(count + 1)
    responses = np.stack([_response(picture, radius / np.sqrt(2)) for radius in radii])
    noise = np.array([_MAD_TO_SD * np.median(np.abs(one - np.median(one))) for one in responses])
    cube = np.ones((3, 3), np.uint8)
    peaks = np.stack([cv2.dilate(one, cube) for one in responses])
    # of the scales next to it, too
    around = np.maximum.reduce([peaks, np.roll(peaks, 1, axis=0), np.roll(peaks, -1, axis=0)])
    limit = np.maximum(_NOISE_LEVELS * noise, _LEAST_SHARE * responses.max())
    strong = (responses >= around) & (responses > limit[:, None, None])
    strong[0] = strong[-1] = False
    places = sorted(np.argwhere(strong).tolist(), key=lambda at: -responses[tuple(at)])[:_MOST]
    found = [
        Candidate(np.array([column, row]) + 0.5, float(radii[scale]), float(_CONTRAST * responses[scale, row, column]))
        for scale, row, column in places
    ]
    return _apart(found)


def _response(picture: np.ndarray, sigma_px: float) -> np.ndarray:
    """Return -sigma^2 times the Laplacian of the picture smoothed by a Gaussian."""
    import cv2

    smooth = cv2.GaussianBlur(picture, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT)
    return -(sigma_px**2) * cv2.Laplacian(smooth, cv2.CV_32F, ksize=1, borderType=cv2.BORDER_REFLECT)


def _apart(found: list[Candidate]) -> list[Candidate]:
    """Return the strongest of blobs whose centres lie in each other."""
    kept: list[Candidate] = []
    for one in found:
        gaps = [np.linalg.norm(one.centre_px - other.centre_px) / max(one.radius_px, other.radius_px) for other in kept]
        if all(gap > _APART for gap in gaps):
            kept.append(one)
    return kept
