"""What is imaged, and the rays through its pixels: a place in the pixel, a time in the exposure, four wavelengths."""

from dataclasses import dataclass

import numpy as np

from uwsim.optics.spectrum import WAVELENGTHS_NM

BANDS = 3


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


class Film:
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
