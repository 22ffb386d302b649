"""The tapered periodogram of a picture and, per size of picture, all that the fit needs of the frequencies.

Source: Dahlhaus and Kuensch, Biometrika 74(4), 1987 (tapers for the spectra of pictures); Tukey's cosine taper.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from uwsim.motion_blur.spectrum import TEXTURE_TERMS, texture_terms

# share of each side that the cosine flanks of the taper take, both ends together: little leakage at little loss
TAPER_SHARE = 0.25
# frequencies nearer to 0 than this many cycles per (short) side belong to shading, not to texture
LOWEST_CYCLES = 3.0
# side of the cells of the coarse fit [cycles per pixel]: several in the stripes of the longest blur
CELL_FREQUENCY = 1 / 85
# bins; what leaks from the steep lower frequencies into the zeros moves them: cut at 2, lengths come out 2 sd short
_LEAKAGE_REACH = 8
_TINY = 1e-12


@dataclass(frozen=True)
class Cells:
    """Neighbouring fitted frequencies put together, C cells."""

    index: np.ndarray  # (fitted,) cell of each fitted frequency
    count: np.ndarray  # (C,) how many are in a cell
    u: np.ndarray  # (C,) mean
    v: np.ndarray  # (C,) mean
    variance: tuple[float, float]  # of u, of v over a cell and through the taper
    terms: np.ndarray  # (C, 14)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the mean (C,) over each cell of values (fitted,)."""
        return np.bincount(self.index, weights=values, minlength=len(self.count)) / self.count


@dataclass(frozen=True)
class Frequencies:
    """Frequencies of `numpy.fft.rfft2`, (H, W // 2 + 1), of pictures (H, W)."""

    u: np.ndarray  # (1, W // 2 + 1) cycles per pixel to the right
    v: np.ndarray  # (H, 1) cycles per pixel down
    fitted: np.ndarray  # (H, W // 2 + 1) bool: one of each pair (u, v), (-u, -v), not too near to 0
    terms: np.ndarray  # (H (W // 2 + 1), 14) `texture_terms`, float32
    lowest_frequency: float
    taper: np.ndarray  # (H, W)
    leakage: tuple[np.ndarray, np.ndarray]  # along v, along u; each sums to 1
    inflation: float  # of variances, for what the taper throws away
    cells: Cells

    def periodogram(self, grey: np.ndarray) -> np.ndarray:
        """Return the periodogram (H, W // 2 + 1) of a picture; white noise of variance s^2 has the mean s^2."""
        from scipy import fft

        centred = grey - (self.taper * grey).sum() / self.taper.sum()
        return np.abs(fft.rfft2(self.taper * centred)) ** 2 / (self.taper**2).sum()

    def power(self, grey: np.ndarray) -> np.ndarray | None:
        """Return the periodogram in single precision; None where a picture shows nothing at the fitted frequencies."""
        power = self.periodogram(grey).astype(np.float32)
        return None if float(power[self.fitted].max()) < _TINY else power

    def leak(self, density: np.ndarray) -> np.ndarray:
        """Return the mean of the periodogram of a density (H, W // 2 + 1): neighbours mix through the taper."""
        from scipy.ndimage import correlate1d

        rows = correlate1d(density, self.leakage[0], axis=0, mode="wrap")
        mirrored = np.roll(rows[::-1], 1, axis=0)
        columns, last, reach = rows.shape[1], (self.taper.shape[1] - 1) // 2, len(self.leakage[1]) // 2
        left, right = (mirrored[:, first - np.arange(reach)] for first in (reach, last))
        padded = np.concatenate([left, rows, right], axis=1)
        return correlate1d(padded, self.leakage[1], axis=1)[:, reach : reach + columns]


@lru_cache(maxsize=8)
def frequencies(height_px: int, width_px: int) -> Frequencies:
    """Return the frequencies of pictures of one size; kept, as films have many frames of one size."""
    from scipy.signal.windows import tukey

    u, v = np.fft.rfftfreq(width_px)[None, :], np.fft.fftfreq(height_px)[:, None]
    lowest = LOWEST_CYCLES / min(height_px, width_px)
    paired = (u == 0) | (u == 0.5)
    fitted = (np.hypot(u, v) >= lowest) & ~(paired & ((v < 0) & (v != -0.5)))
    sides = [tukey(side, TAPER_SHARE, sym=False) for side in (height_px, width_px)]
    inflation = float(np.prod([len(w) * (w**4).sum() / (w**2).sum() ** 2 for w in sides]))
    leakage = tuple(_leakage(w) for w in sides)
    return Frequencies(
        u=u, v=v, fitted=fitted, lowest_frequency=lowest, taper=sides[0][:, None] * sides[1],
        terms=texture_terms(u, v, lowest_frequency=lowest).reshape(-1, TEXTURE_TERMS).astype(np.float32),
        leakage=leakage, inflation=inflation,
        cells=_cells(
            *(np.broadcast_to(f, fitted.shape)[fitted] for f in (u, v)), lowest, leakage, (height_px, width_px)
        ),
    )  # fmt: skip


def _leakage(window: np.ndarray) -> np.ndarray:
    power = np.abs(np.fft.fft(window)) ** 2
    reach = min(_LEAKAGE_REACH, (len(window) - 1) // 2)
    near = power[np.arange(-reach, reach + 1)]
    return near / near.sum()


def _cells(
    u: np.ndarray,
    v: np.ndarray,
    lowest_frequency: float,
    leakage: tuple[np.ndarray, np.ndarray],
    shape: tuple[int, int],
) -> Cells:
    rows = np.round(v / CELL_FREQUENCY).astype(int)
    columns = np.floor(u / CELL_FREQUENCY).astype(int)
    _, index = np.unique((rows - rows.min()) * (columns.max() + 1) + columns, return_inverse=True)
    count = np.bincount(index)
    mean_u, mean_v = (np.bincount(index, weights=f) / count for f in (u, v))
    variance = tuple(
        float(
            ((f - mean[index]) ** 2).mean()
            + (kernel * (np.arange(len(kernel)) - len(kernel) // 2) ** 2).sum() / side**2
        )
        for f, mean, kernel, side in zip((u, v), (mean_u, mean_v), leakage[::-1], shape[::-1], strict=True)
    )
    terms = texture_terms(mean_u, mean_v, lowest_frequency=lowest_frequency)
    return Cells(index=index, count=count.astype(float), u=mean_u, v=mean_v, variance=variance, terms=terms)
