"""Monte-Carlo estimates of band radiance: rays through the pixels, an integrator, sums."""

import dataclasses

import numpy as np

from uwsim.optics import phase
from uwsim.optics.water import Water
from uwsim.render.accumulate import Progress, Sums, accumulate
from uwsim.render.build import Added, Built, load_medium
from uwsim.render.film import View
from uwsim.render.stopping import check_samples


def layers(
    built: Built, view: View, *, samples_per_pixel: int, batches: int, seed: int, progress: Progress | None = None
) -> dict[str, np.ndarray]:
    """Return `direct`, `forward_scatter`, `backscatter`, their sum `radiance` and its `standard_error`.

    Each (H, W, 3) [W m^-2 sr^-1 nm^-1], float32; without water all light is direct. The standard error comes from
    `batches` independent batches with own seeds. Raises ValueError unless `samples_per_pixel` is a multiple of
    `batches` and there are at least 2 batches.
    """
    check_samples(samples_per_pixel, batches)
    sums = accumulate(
        built, view, estimate(built), samples_per_pixel=samples_per_pixel, batches=batches, seed=seed, progress=progress
    )
    return pictures(sums)


def estimate(built: Built, *, orders: bool = False):
    """Return the estimate, (rays, sampler) -> [radiance, its layers], whose sums `pictures` takes.

    `orders`: with `integrator.ORDERS` after the layers.
    """
    from uwsim.render.integrator import LAYERS, LampWalk

    walk = LampWalk(built)

    def estimated(rays, sampler):
        parts = walk(rays, sampler)
        layers = parts[: len(LAYERS)]
        return [sum(layers[1:], layers[0]), *(parts if orders else layers)]

    return estimated


def pictures(sums: Sums) -> dict[str, np.ndarray]:
    """Return the images of `layers`, and of `integrator.ORDERS` where they were asked for, from at least 2 batches."""
    from uwsim.render.integrator import LAYERS, ORDERS

    parts = [mean.astype(np.float32) for mean in sums.means[1:]]
    found = dict(zip((*LAYERS, *ORDERS), parts, strict=False))
    direct, forward_scatter, backscatter = parts[: len(LAYERS)]
    return found | {
        "radiance": direct + forward_scatter + backscatter,
        "standard_error": sums.standard_error().astype(np.float32),
    }


def reference_radiance(
    built: Built, view: View, *, samples_per_pixel: int, batches: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return radiance (H, W, 3) and its standard error by Mitsuba's own integrator: slower to converge, independent."""
    check_samples(samples_per_pixel, batches)
    sums = accumulate(built, view, _reference(built), samples_per_pixel=samples_per_pixel, batches=batches, seed=seed)
    return sums.means[0].astype(np.float32), sums.standard_error().astype(np.float32)


def _reference(built: Built):
    integrator = built.scene.integrator()
    return lambda rays, sampler: [integrator.sample(built.scene, sampler, rays, built.medium, True)[0]]


def transmission(
    built: Built, view: View, *, attenuation: np.ndarray, samples_per_pixel: int, seed: int, added: Added | None = None,
) -> np.ndarray:  # fmt: skip
    """Return the share of light, by way of the body seen, that is neither absorbed nor scattered, (H, W, 3).

    Light straight from the lamps and the sun, and from the lamps by way of the water surface; not the sky's. The ratio
    of two sums over the same light paths source-body-camera, with `attenuation` (61,) [1/m] and the waters `added` to
    it, and without. 0 where no body is seen or none of that light reaches it.
    """
    import drjit as dr
    import mitsuba as mi

    from uwsim.render.world import World

    water = Water("attenuating", attenuation, np.zeros_like(attenuation), phase.constant([0.0], [1.0]))
    medium = load_medium(mi, water, even_if_empty=added is not None)
    world = World(dataclasses.replace(built, water=water, medium=medium, added=added))

    def estimate(rays, sampler):
        k = None if world.medium is None else world.medium.coefficients(rays.wavelengths)
        met = world.meet(rays, mi.Bool(True))
        own = world.medium_depth(k, rays.o, rays.d, dr.select(met.body, met.length, 0.0), met.body)
        seen, unattenuated = mi.Spectrum(0.0), mi.Spectrum(0.0)
        for light in world.lights:
            came = light.arriving(met.si, mi.Point2f(0.5), world, k, met.body)
            bsdf = met.si.bsdf().eval(mi.BSDFContext(), met.si, met.si.to_local(came.direction), came.visible)
            reflected = dr.select(came.visible, came.irradiance * bsdf, 0.0)
            unattenuated += reflected
            seen += dr.select(came.visible, reflected * dr.exp(-own - came.depth), 0.0)
        return [seen, unattenuated]

    seen, whole = accumulate(built, view, estimate, samples_per_pixel=samples_per_pixel, batches=1, seed=seed).sums
    return np.where(whole > 0, seen / np.where(whole > 0, whole, 1), 0).astype(np.float32)
