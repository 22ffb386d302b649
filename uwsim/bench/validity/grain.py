"""How finely a noisy truth can be compared: single pixels where they are good enough, else blocks of them.

Rendered light has heavy tails: one bright path may hold more squared error than the rest of the picture. Two things
follow, chosen from the truth alone, so that all models are compared alike. Pixels (blocks) whose standard error is many
times the picture's median may be left out; the share of the light that they hold is then not known either, and counts
as error that cannot be seen. And the picture is compared in the smallest blocks of 1, 2, 4, 8 or 16 pixels in which an
error of 2 % can be told from noise and from what is left out.
"""

from dataclasses import dataclass

import numpy as np

from uwsim.metrics import radiance

SIZES_PX = (1, 2, 4, 8, 16)
RESOLUTION_PERCENT = 2.0
_OUTLIERS = (10.0, 20.0, 50.0, 100.0, np.inf)  # of the median standard error


@dataclass(frozen=True)
class Grain:
    """Blocks of `size_px`; `kept` (rows, columns) bool; `left_out_percent` of the light.

    `resolution_percent`: relative error that noise (one standard deviation) and what is left out may hide.
    """

    size_px: int
    kept: np.ndarray
    left_out_percent: float
    resolution_percent: float

    def of(self, image: np.ndarray) -> np.ndarray:
        """Return the means of the blocks kept of an image (H, W, C), (n, C)."""
        return means(image, size_px=self.size_px)[self.kept]

    def error_of(self, standard_error: np.ndarray) -> np.ndarray:
        """Return the standard errors of those means, (n, C), from that of the pixels (H, W, C)."""
        return _mean_errors(standard_error, size_px=self.size_px)[self.kept]

    def relative_error(self, truth: np.ndarray, estimate: np.ndarray, *, standard_error: np.ndarray) -> float:
        """Return `metrics.radiance.relative_error` between two images (H, W, C) in these blocks. [%]"""
        error = self.error_of(standard_error)
        return radiance.relative_error(self.of(truth), self.of(estimate), standard_error=error)


def grain_of(truth: np.ndarray, *, standard_error: np.ndarray, batches: int) -> Grain:
    """Return the finest grain in which errors of 2 % show; the one in which the smallest do where they do in none.

    `truth`, `standard_error` (H, W, C), the latter from `batches`.
    """
    found = []
    for size in SIZES_PX:
        light, error = means(truth, size_px=size), _mean_errors(standard_error, size_px=size)
        cuts = [_cut(light, error, size_px=size, most=most, batches=batches) for most in _OUTLIERS]
        found.append(min(cuts, key=lambda cut: cut.resolution_percent))
        if found[-1].resolution_percent <= RESOLUTION_PERCENT:
            return found[-1]
    return min(found, key=lambda grain: grain.resolution_percent)


def _cut(light: np.ndarray, error: np.ndarray, *, size_px: int, most: float, batches: int) -> Grain:
    """Return the grain in which blocks with more than `most` times the median standard error are left out."""
    total = np.sqrt(np.square(error).sum(axis=-1))
    kept = total <= most * np.median(total) if np.isfinite(most) else np.ones(total.shape, bool)
    left_out = 100 * float(1 - light[kept].sum() / light.sum()) if light.sum() > 0 else 0.0
    hidden = radiance.resolution(light[kept], standard_error=error[kept], batches=batches)
    # of noise alone there may be nothing else: then nothing can be seen
    return Grain(size_px, kept, left_out, float(np.hypot(hidden, left_out)) if np.isfinite(hidden) else 100.0)


def means(image: np.ndarray, *, size_px: int) -> np.ndarray:
    """Return the means of an image (H, W, C) over blocks of size_px x size_px, the last ones cut off by its edge."""
    starts = [np.arange(0, length, size_px) for length in image.shape[:2]]
    sums = np.add.reduceat(np.add.reduceat(np.asarray(image, float), starts[0], axis=0), starts[1], axis=1)
    return sums / _counts(image.shape, size_px)


def _counts(shape: tuple[int, ...], size_px: int) -> np.ndarray:
    rows, columns = (np.diff(np.arange(0, length, size_px), append=length) for length in shape[:2])
    return np.outer(rows, columns)[..., None]


def _mean_errors(standard_error: np.ndarray, *, size_px: int) -> np.ndarray:
    variance = means(np.square(np.asarray(standard_error, float)), size_px=size_px)
    return np.sqrt(variance / _counts(standard_error.shape, size_px))
