"""Monte-Carlo estimates of band radiance: rays through the pixels, an integrator, sums."""

import numpy as np

from uwsim.render.accumulate import Progress, accumulate, check_samples
from uwsim.render.build import Built
from uwsim.render.film import View
from uwsim.render.shapes import spectrum


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
    sums, squares = accumulate(
        built, view, estimate, samples_per_pixel=samples_per_pixel, batches=batches, seed=seed, progress=progress
    )
    means = [total / batches for total in sums]
    variances = [np.maximum(s / batches - m**2, 0) / (batches - 1) for s, m in zip(squares, means, strict=True)]
    return means, [np.sqrt(variance) for variance in variances]


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

    (seen, whole), _ = accumulate(
        built, view, estimate, samples_per_pixel=samples_per_pixel, batches=1, seed=seed, progress=None
    )
    return np.where(whole > 0, seen / np.where(whole > 0, whole, 1), 0).astype(np.float32)
