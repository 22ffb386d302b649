"""Sums of Monte-Carlo estimates over the samples of every pixel, in a fixed order.

Sums over the samples of a pixel are block sums and batches are added in order, so the result does not depend on the
number of threads.
"""

from collections.abc import Callable

import numpy as np

from uwsim.render.film import BANDS, Film

Progress = Callable[[int, int], None]
# Samples that one launch may hold; bounds memory.
_LAUNCH_SAMPLES = 1 << 22
_ROW_SAMPLES = 1 << 24


def accumulate(built, view, estimate, *, samples_per_pixel, batches, seed, progress):
    """Return sums over batches of the batch means, and of their squares, of every quantity that `estimate` gives."""
    import drjit as dr
    import mitsuba as mi

    film = Film(view)
    per_batch = samples_per_pixel // batches
    if view.width_px * per_batch > _ROW_SAMPLES:
        raise ValueError(
            f"samples_per_pixel: {samples_per_pixel} in {batches} batches makes {view.width_px * per_batch} samples "
            f"per image row and batch, allowed: {_ROW_SAMPLES} (memory); use more batches"
        )
    rows = max(1, min(view.height_px, _LAUNCH_SAMPLES // (view.width_px * per_batch)))
    launches = [(batch, top) for batch in range(batches) for top in range(0, view.height_px, rows)]
    sums = squares = None
    sampler = mi.load_dict({"type": "independent"})
    for done, (batch, top) in enumerate(launches):
        height = min(rows, view.height_px - top)
        count = height * view.width_px * per_batch
        launch_seed = _launch_seed(seed, batch, top)
        sampler.seed(mi.UInt32(launch_seed), count)
        rays, weights = film.rays(built.world_from_camera, sampler, top, per_batch, count, launch_seed)
        values = estimate(rays, sampler)
        bands = [[dr.block_sum(dr.mean(value * weight), per_batch) for weight in weights] for value in values]
        dr.eval(bands)
        means = [np.stack([band.numpy() for band in quantity], axis=-1) / per_batch for quantity in bands]
        if sums is None:
            sums = [np.zeros((view.height_px, view.width_px, BANDS)) for _ in means]
            squares = [np.zeros_like(total) for total in sums]
        for total, square, mean in zip(sums, squares, means, strict=True):
            image = mean.reshape(height, view.width_px, BANDS).astype(np.float64)
            total[top : top + height] += image
            square[top : top + height] += image**2
        if progress is not None:
            progress(done + 1, len(launches))
    return sums, squares


def check_samples(samples_per_pixel: int, batches: int) -> None:
    """Raise ValueError unless the samples can be split into at least 2 equal batches."""
    if batches < 2 or samples_per_pixel < batches or samples_per_pixel % batches:
        raise ValueError(
            f"samples_per_pixel: got {samples_per_pixel} in {batches} batches, "
            "allowed: a multiple of the batches, at least 2 of them"
        )


def _launch_seed(seed: int, batch: int, top: int) -> int:
    return int(np.random.SeedSequence([seed, batch, top]).generate_state(1)[0] >> 1)
