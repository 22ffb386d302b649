"""Monte-Carlo estimates of band radiance: rays through the pixels, an integrator, sums in a fixed order.

Every sample draws a place in its pixel, a time in the exposure and four wavelengths. Sums over the samples of
a pixel are block sums and batches are added in order, so the result does not depend on the number of threads.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render.build import Built
from uwsim.render.shapes import spectrum

Progress = Callable[[int, int], None]
BANDS = 3
# Samples that one launch may hold; bounds memory.
_LAUNCH_SAMPLES = 1 << 22
_ROW_SAMPLES = 1 << 24


@dataclass(frozen=True)
class View:
    """What is imaged: size, K (3, 3) [px], band response (61, 3), and where to draw wavelengths (61,)."""

    width_px: int
    height_px: int
    K: np.ndarray
    response: np.ndarray
    importance: np.ndarray

    @property
    def pixels(self) -> int:
        return self.width_px * self.height_px


def view_of(scene) -> View:
    """Return the view of a scene's camera; wavelengths are drawn by response x lamp light."""
    from uwsim.optics.sources import camera_response

    camera = scene.rig.camera
    response = camera_response(camera.response)
    light = sum(lamp.intensity_w_per_sr * lamp.relative_spectrum for lamp in scene.rig.lamps)
    importance = (response / np.trapezoid(response, WAVELENGTHS_NM, axis=0)).sum(axis=1)
    importance = importance * (light / light.max())
    # a floor keeps every wavelength that a band sees within reach, also where the lamps are dark
    importance = np.maximum(importance, 0.02 * importance.max() * (response.max(axis=1) > 0))
    return View(camera.width_px, camera.height_px, camera.K, response, importance)


def layers(
    built: Built, view: View, *, samples_per_pixel: int, batches: int, seed: int, progress: Progress | None = None
) -> dict[str, np.ndarray]:
    """Return `direct`, `forward_scatter`, `backscatter`, their sum `radiance` and its `standard_error`.

    Each (H, W, 3) [W m^-2 sr^-1 nm^-1], float32; without water all light is direct. The standard error comes from
    `batches` independent batches with own seeds. Raises ValueError unless `samples_per_pixel` is a multiple of
    `batches` and there are at least 2 batches.
    """
    estimate = _reference(built) if built.medium is None else _lamp_walk(built)
    means, errors = _estimated(built, view, estimate, samples_per_pixel, batches, seed, progress)
    parts = [mean.astype(np.float32) for mean in means[1:]] or [means[0].astype(np.float32)]
    parts += [np.zeros_like(parts[0])] * (3 - len(parts))
    direct, forward_scatter, backscatter = parts
    return {
        "direct": direct,
        "forward_scatter": forward_scatter,
        "backscatter": backscatter,
        "radiance": direct + forward_scatter + backscatter,
        "standard_error": errors[0].astype(np.float32),
    }


def reference_radiance(
    built: Built, view: View, *, samples_per_pixel: int, batches: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return radiance (H, W, 3) and its standard error by Mitsuba's own integrator: slower to converge, independent."""
    means, errors = _estimated(built, view, _reference(built), samples_per_pixel, batches, seed, None)
    return means[0].astype(np.float32), errors[0].astype(np.float32)


def _reference(built: Built):
    integrator = built.scene.integrator()
    return lambda rays, sampler: [integrator.sample(built.scene, sampler, rays, built.medium, True)[0]]


def _lamp_walk(built: Built):
    from uwsim.render.integrator import LampWalk

    walk = LampWalk(built)

    def estimate(rays, sampler):
        direct, forward_scatter, backscatter = walk(rays, sampler)
        return [direct + forward_scatter + backscatter, direct, forward_scatter, backscatter]

    return estimate


def _estimated(built, view, estimate, samples_per_pixel, batches, seed, progress):
    """Return means and standard errors over batches of every quantity that `estimate` gives."""
    check_samples(samples_per_pixel, batches)
    sums, squares = _accumulate(
        built, view, estimate, samples_per_pixel=samples_per_pixel, batches=batches, seed=seed, progress=progress
    )
    means = [total / batches for total in sums]
    variances = [np.maximum(s / batches - m**2, 0) / (batches - 1) for s, m in zip(squares, means, strict=True)]
    return means, [np.sqrt(variance) for variance in variances]


def check_samples(samples_per_pixel: int, batches: int) -> None:
    """Raise ValueError unless the samples can be split into at least 2 equal batches."""
    if batches < 2 or samples_per_pixel < batches or samples_per_pixel % batches:
        raise ValueError(
            f"samples_per_pixel: got {samples_per_pixel} in {batches} batches, "
            "allowed: a multiple of the batches, at least 2 of them"
        )


def transmission(
    built: Built, view: View, *, attenuation: np.ndarray, samples_per_pixel: int, seed: int,
) -> np.ndarray:  # fmt: skip
    """Return the share of lamp light, by way of the body seen, that is neither absorbed nor scattered, (H, W, 3).

    The ratio of two sums over the same light paths lamp-body-camera, with `attenuation` (61,) [1/m] and
    without. 0 where no body is seen or no lamp reaches it.
    """
    import drjit as dr
    import mitsuba as mi

    coefficient = mi.load_dict(spectrum(attenuation))

    def estimate(rays, sampler):
        si = built.scene.ray_intersect(rays)
        seen, unattenuated = mi.Spectrum(0.0), mi.Spectrum(0.0)
        at_wavelength = dr.zeros(mi.SurfaceInteraction3f)
        at_wavelength.wavelengths = rays.wavelengths
        c = coefficient.eval(at_wavelength)
        for emitter in built.scene.emitters():
            ds, light = emitter.sample_direction(si, mi.Point2f(0.5), si.is_valid())
            reaches = si.is_valid() & ~built.scene.ray_test(si.spawn_ray_to(ds.p), si.is_valid())
            reflected = light * si.bsdf().eval(mi.BSDFContext(), si, si.to_local(ds.d), reaches)
            unattenuated += reflected & reaches
            seen += (reflected * dr.exp(-c * (si.t + ds.dist))) & reaches
        return [seen, unattenuated]

    (seen, whole), _ = _accumulate(
        built, view, estimate, samples_per_pixel=samples_per_pixel, batches=1, seed=seed, progress=None
    )
    return np.where(whole > 0, seen / np.where(whole > 0, whole, 1), 0).astype(np.float32)


def _accumulate(built, view, estimate, *, samples_per_pixel, batches, seed, progress):
    """Return sums over batches of the batch means, and of their squares, of every quantity that `estimate` gives."""
    import drjit as dr
    import mitsuba as mi

    film = _Film(view)
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


def _launch_seed(seed: int, batch: int, top: int) -> int:
    return int(np.random.SeedSequence([seed, batch, top]).generate_state(1)[0] >> 1)


class _Film:
    """Draws rays and wavelengths, and weights the light that they bring into bands."""

    def __init__(self, view: View):
        import mitsuba as mi

        span = mi.ScalarVector2f(float(WAVELENGTHS_NM[0]), float(WAVELENGTHS_NM[-1]))
        self.view = view
        self.inverse_K = mi.ScalarMatrix3f(np.linalg.inv(view.K))
        self.wavelengths = mi.ContinuousDistribution(span, mi.Float(view.importance.astype(np.float32)))
        self.responses = [
            mi.ContinuousDistribution(span, mi.Float(band.astype(np.float32))) for band in view.response.T
        ]

    def rays(self, world_from_camera: np.ndarray, sampler, top: int, per_pixel: int, count: int, seed: int):
        """Return `count` rays, pixel by pixel from row `top`, and per band the weight of each wavelength."""
        import drjit as dr
        import mitsuba as mi

        index = dr.arange(mi.UInt32, count)
        per_pixel = dr.opaque(mi.UInt32, per_pixel)
        pixel, sample = index // per_pixel, index % per_pixel
        x, y = pixel % self.view.width_px, pixel // self.view.width_px + dr.opaque(mi.UInt32, top)
        place, time_shift, wavelength_shift = sampler.next_2d(), sampler.next_1d(), sampler.next_1d()
        # Time and wavelength are both stratified over the samples of a pixel. A random offset per pixel and launch
        # between the two orders makes every pairing equally likely: without it the estimate would be biased.
        time = (mi.Float(sample) + time_shift) / mi.Float(per_pixel)
        order = (sample + mi.sample_tea_32(pixel, dr.opaque(mi.UInt32, seed))[0] % per_pixel) % per_pixel
        wavelengths, pdf = self._draw_wavelengths((mi.Float(order) + wavelength_shift) / mi.Float(per_pixel))

        to_world, origin = _poses_at(world_from_camera, time)
        local = self.inverse_K @ mi.Vector3f(mi.Float(x) + place.x, mi.Float(y) + place.y, 1.0)
        rays = mi.RayDifferential3f(mi.Ray3f(origin, dr.normalize(to_world @ local)))
        rays.time = time
        rays.wavelengths = wavelengths
        weights = []
        for response in self.responses:
            weight = mi.Spectrum(0.0)
            for channel in range(4):
                weight[channel] = response.eval_pdf_normalized(wavelengths[channel]) / pdf[channel]
            weights.append(weight)
        return rays, weights

    def _draw_wavelengths(self, uniform):
        import drjit as dr
        import mitsuba as mi

        wavelengths, pdf = mi.Spectrum(0.0), mi.Spectrum(0.0)
        shifted = mi.sample_shifted(uniform)
        for channel in range(4):
            inside = dr.clip(shifted[channel], 2e-7, 1 - 2e-7)  # at 0 and 1 the density may be 0
            wavelengths[channel], pdf[channel] = self.wavelengths.sample_pdf(inside)
        return wavelengths, pdf


def _poses_at(world_from_camera: np.ndarray, time):
    """Return rotation and position of the camera at times in [0, 1) of the exposure, from n equal steps."""
    import drjit as dr
    import mitsuba as mi

    steps = len(world_from_camera)
    table = mi.Float(np.ascontiguousarray(world_from_camera[:, :3, :], dtype=np.float32).ravel())
    step = dr.minimum(mi.UInt32(time * steps), steps - 1)
    m = [dr.gather(mi.Float, table, step * 12 + k) for k in range(12)]
    return mi.Matrix3f([[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]]), mi.Point3f(m[3], m[7], m[11])
