"""Sums of Monte-Carlo estimates over the samples of every pixel, in independent batches and a fixed order.

Every batch has the same number of samples and seeds of its own. Sums over the samples of a pixel are block sums and
batches are added in order, so the result depends neither on the number of threads nor on whether the sums were stored
and taken up again in between.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uwsim.render.film import BANDS, Film, View
from uwsim.render.stopping import region_means

Progress = Callable[[int, int], None]
# Samples that one launch may hold; bounds memory.
_LAUNCH_SAMPLES = 1 << 22
# Samples of one image row that are still one launch; beyond, a row's samples are split over launches.
_ROW_SAMPLES = 1 << 24


@dataclass
class Sums:
    """Sums over batches of the batch means, and of their squares.

    sums, squares: of every quantity estimated, (quantities, H, W, 3), float64.
    region_sums, region_squares: of the means over regions of the first quantity (see `stopping.region_means`).
    """

    batches: int
    sums: np.ndarray
    squares: np.ndarray
    region_sums: np.ndarray
    region_squares: np.ndarray

    @property
    def means(self) -> np.ndarray:
        return self.sums / self.batches

    def standard_error(self, quantity: int = 0) -> np.ndarray:
        """Return the standard error of the mean of one quantity, (H, W, 3); at least 2 batches."""
        mean = self.sums[quantity] / self.batches
        return np.sqrt(np.maximum(self.squares[quantity] / self.batches - mean**2, 0) / (self.batches - 1))


class Accumulator:
    """Adds batches of an estimate to `sums`, which may come from before (they are changed in place).

    Where bodies move, every batch runs through all sub-frames with equally many samples: `samples_per_batch` is then
    what was asked for, raised to a multiple of their number.
    """

    def __init__(self, built, view: View, estimate, *, samples_per_batch: int, seed: int, sums: Sums | None = None):
        import mitsuba as mi

        self.built, self.view, self.estimate = built, view, estimate
        self.parts = 1 if built.sub_frames is None else built.sub_frames.count
        per_part = -(-samples_per_batch // self.parts)
        self.samples_per_batch, self.seed, self.sums = per_part * self.parts, seed, sums
        self.launches = [(part, *launch) for part in range(self.parts) for launch in _launches(view, per_part)]
        self._film, self._sampler = Film(view), mi.load_dict({"type": "independent"})

    @property
    def batches(self) -> int:
        return 0 if self.sums is None else self.sums.batches

    def add_batch(self, progress: Callable[[], None] | None = None) -> None:
        """Render one more batch; `progress` is called after each launch."""
        batch, mean, shown = self.batches, None, None
        for part, top, height, share, samples in self.launches:
            if self.parts > 1 and part != shown:
                self.built.sub_frames.show(part)
                shown = part
            values = self._launch(batch, part, top, height, share, samples)
            if mean is None:
                mean = np.zeros((len(values), self.view.height_px, self.view.width_px, BANDS))
            mean[:, top : top + height] += values * (samples / self.samples_per_batch)
            if progress is not None:
                progress()
        self._add(mean)

    def _launch(self, batch: int, part: int, top: int, height: int, share: int, samples: int) -> np.ndarray:
        """Return the means over `samples` per pixel of every quantity, (quantities, height, W, 3)."""
        import drjit as dr
        import mitsuba as mi

        count = height * self.view.width_px * samples
        self._sampler.seed(mi.UInt32(_launch_seed(self.seed, batch, top, share, part)), count)
        rays, weights = self._film.rays(
            self.built.world_from_camera, self._sampler, top, samples, count,
            _launch_seed(self.seed, batch, top, share), part=part, parts=self.parts,
        )  # fmt: skip
        values = self.estimate(rays, self._sampler)
        bands = [[dr.mean(value * weight) for weight in weights] for value in values]
        # all at once: a sum over blocks evaluates what it is given, and with it the whole loop again
        dr.eval(bands)
        bands = [[dr.block_sum(band, samples) for band in quantity] for quantity in bands]
        dr.eval(bands)
        means = [np.stack([band.numpy() for band in quantity], axis=-1) / samples for quantity in bands]
        return np.stack(means).reshape(len(means), height, self.view.width_px, BANDS).astype(np.float64)

    def _add(self, mean: np.ndarray) -> None:
        regions = region_means(mean[0])
        if self.sums is None:
            self.sums = Sums(
                0, np.zeros_like(mean), np.zeros_like(mean), np.zeros_like(regions), np.zeros_like(regions)
            )
        self.sums.sums += mean
        self.sums.squares += np.square(mean, out=mean)
        self.sums.region_sums += regions
        self.sums.region_squares += regions**2
        self.sums.batches += 1


def accumulate(built, view, estimate, *, samples_per_pixel, batches, seed, progress=None) -> Sums:
    """Return the sums of `samples_per_pixel` samples in `batches` equal batches.

    estimate: (rays, sampler) -> list of spectra, one for each quantity.
    progress: called with (launches done, launches in all).
    """
    accumulator = Accumulator(built, view, estimate, samples_per_batch=samples_per_pixel // batches, seed=seed)
    done = _Counter(progress, len(accumulator.launches) * batches)
    for _ in range(batches):
        accumulator.add_batch(done)
    return accumulator.sums


class _Counter:
    def __init__(self, progress: Progress | None, total: int):
        self.progress, self.done, self.total = progress, 0, total

    def __call__(self) -> None:
        self.done += 1
        if self.progress is not None:
            self.progress(self.done, self.total)


def _launches(view: View, samples: int) -> list[tuple[int, int, int, int]]:
    """Return what to launch for one batch: first row, rows, which share of the samples, samples per pixel.

    Whole rows with all samples where they fit, else one row at a time with the samples in shares.
    """
    if view.width_px * samples <= _ROW_SAMPLES:
        rows = max(1, min(view.height_px, _LAUNCH_SAMPLES // (view.width_px * samples)))
        return [(top, min(rows, view.height_px - top), 0, samples) for top in range(0, view.height_px, rows)]
    shares = -(-view.width_px * samples // _LAUNCH_SAMPLES)
    sizes = np.diff(np.arange(min(shares, samples) + 1) * samples // min(shares, samples)).tolist()
    return [(top, 1, share, size) for top in range(view.height_px) for share, size in enumerate(sizes)]


def _launch_seed(seed: int, batch: int, top: int, share: int, part: int = 0) -> int:
    entropy = [seed, batch, top, share, part] if part else [seed, batch, top, share] if share else [seed, batch, top]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0] >> 1)
