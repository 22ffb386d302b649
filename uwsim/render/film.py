"""What is imaged, and the rays through its pixels: a place in the pixel, a time in the exposure, four wavelengths."""

from dataclasses import dataclass

import numpy as np

from uwsim.camera import distortion
from uwsim.camera.dome_port import DomePort
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import Lens
from uwsim.camera.shutter import Shutter
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render.shapes import tensor

BANDS = 3


@dataclass(frozen=True)
class View:
    """What is imaged: size, lens, band response (61, 3), where to draw wavelengths (61,), when rows are exposed."""

    width_px: int
    height_px: int
    lens: Lens
    response: np.ndarray
    importance: np.ndarray
    shutter: Shutter

    @property
    def K(self) -> np.ndarray:
        """Camera matrix (3, 3) of the lens. [px]"""
        return self.lens.K

    @property
    def pixels(self) -> int:
        return self.width_px * self.height_px


def view_of(scene) -> View:
    """Return the view of a scene's camera; wavelengths are drawn by response x light of lamps and day."""
    from uwsim.optics.sources import camera_response

    camera = scene.rig.camera
    response = camera_response(camera.response)
    light = np.zeros(len(WAVELENGTHS_NM))
    if scene.rig.lamps:
        lamps = sum(lamp.intensity_w_per_sr * lamp.relative_spectrum for lamp in scene.rig.lamps)
        light = lamps / lamps.max()
    if scene.daylight is not None and not scene.daylight.is_dark:
        light = light + scene.daylight.relative_spectrum / scene.daylight.relative_spectrum.max()
    importance = (response / np.trapezoid(response, WAVELENGTHS_NM, axis=0)).sum(axis=1)
    importance = importance * (light / light.max())
    # a floor keeps every wavelength that a band sees within reach, also where the lamps are dark
    importance = np.maximum(importance, 0.02 * importance.max() * (response.max(axis=1) > 0))
    return View(camera.width_px, camera.height_px, scene.lens, response, importance, scene.shutter)


def sensor_description(view: View, world_from_camera: np.ndarray) -> dict:
    """Return the Mitsuba description of a view's sensor; `world_from_camera` (n, 4, 4) at n equal steps of the span.

    For Mitsuba's own integrators put film, sampler and `medium` (that of the water) in it.
    """
    import mitsuba as mi

    lens, shutter = view.lens, view.shutter
    description = {
        "poses": tensor(mi, np.asarray(world_from_camera)[:, :3, :]),
        "inverse_K": tensor(mi, np.linalg.inv(view.K).ravel()),
        "exposure_share": shutter.exposure_s / shutter.span_s if shutter.readout_s > 0 else 1.0,
        "shutter_open": 0.0,
        "shutter_close": 1.0,
        "film": {"type": "hdrfilm", "width": view.width_px, "height": view.height_px},
    }
    if lens.is_distorted:
        # without a fold: a radius that no ray has
        fold = min(distortion.fold_radius(coefficients=lens.coefficients), 1e6)
        numbers = [*distortion.checked(lens.coefficients), fold]
        description["distortion"] = tensor(mi, np.array(numbers))
    return description | _port_description(mi, lens.port)


def _port_description(mi, port) -> dict:
    if port is None:
        return {"type": "pinhole_water"}
    glass = {"n_air": port.n_air, "n_glass": port.n_glass, "n_water": port.n_water}
    glass["glass_absorption"] = port.glass_absorption_per_m
    match port:
        case FlatPort():
            own = {"type": "flat_port", "gap": port.gap_m, "thickness": port.thickness_m}
            return glass | own | {"normal": tensor(mi, port.axis)}
        case DomePort():
            own = {"type": "dome_port", "inner_radius": port.inner_radius_m, "outer_radius": port.outer_radius_m}
            return glass | own | {"decentring": tensor(mi, np.array(port.decentring_m))}
    raise TypeError(f"no sensor for a port of type {type(port).__name__}")


class Film:
    """Draws rays and wavelengths, and weights the light that they bring into bands."""

    def __init__(self, view: View):
        import mitsuba as mi

        span = mi.ScalarVector2f(float(WAVELENGTHS_NM[0]), float(WAVELENGTHS_NM[-1]))
        self.view = view
        self.sensor, self.poses = None, None
        self.wavelengths = mi.ContinuousDistribution(span, mi.Float(view.importance.astype(np.float32)))
        self.responses = [
            mi.ContinuousDistribution(span, mi.Float(band.astype(np.float32))) for band in view.response.T
        ]

    def rays(
        self, world_from_camera: np.ndarray, sampler, top: int, per_pixel: int, count: int, seed: int,
        *, part: int = 0, parts: int = 1,
    ):  # fmt: skip
        """Return `count` rays, pixel by pixel from row `top`, and per band the weight of each wavelength.

        Their times are those of the `part`, from 0, of `parts` equal ones of the exposure; the `per_pixel` rays of all
        parts together are stratified, if `seed` is the same for all.
        """
        import drjit as dr
        import mitsuba as mi

        index = dr.arange(mi.UInt32, count)
        in_all, before = dr.opaque(mi.UInt32, per_pixel * parts), dr.opaque(mi.UInt32, per_pixel * part)
        per_pixel = dr.opaque(mi.UInt32, per_pixel)
        pixel, sample = index // per_pixel, index % per_pixel + before
        x, y = pixel % self.view.width_px, pixel // self.view.width_px + dr.opaque(mi.UInt32, top)
        place, time_shift, wavelength_shift = sampler.next_2d(), sampler.next_1d(), sampler.next_1d()
        # Time and wavelength are both stratified over the samples of a pixel. A random offset per pixel and launch
        # between the two orders makes every pairing equally likely: without it the estimate would be biased.
        time = (mi.Float(sample) + time_shift) / mi.Float(in_all)
        order = (sample + mi.sample_tea_32(pixel, dr.opaque(mi.UInt32, seed))[0] % in_all) % in_all
        wavelengths, pdf = self._draw_wavelengths((mi.Float(order) + wavelength_shift) / mi.Float(in_all))

        sensor = self._sensor_on(world_from_camera)
        ray, seen = sensor.rays(mi.Point2f(mi.Float(x) + place.x, mi.Float(y) + place.y), time)
        rays = mi.RayDifferential3f(ray)
        rays.wavelengths = wavelengths
        weights = []
        for response in self.responses:
            weight = mi.Spectrum(0.0)
            for channel in range(4):
                weight[channel] = response.eval_pdf_normalized(wavelengths[channel]) / pdf[channel]
            weights.append(weight * seen)
        return rays, weights

    def _sensor_on(self, world_from_camera: np.ndarray):
        """Return the sensor on a path, the one before if the path is the same."""
        import mitsuba as mi

        if self.sensor is None or self.poses is not world_from_camera:
            self.sensor = mi.load_dict(sensor_description(self.view, world_from_camera))
            self.poses = world_from_camera
        return self.sensor

    def _draw_wavelengths(self, uniform):
        """Return four wavelengths for uniform numbers, and their densities."""
        import drjit as dr
        import mitsuba as mi

        wavelengths, pdf = mi.Spectrum(0.0), mi.Spectrum(0.0)
        shifted = mi.sample_shifted(uniform)
        for channel in range(4):
            inside = dr.clip(shifted[channel], 2e-7, 1 - 2e-7)  # at 0 and 1 the density may be 0
            wavelengths[channel], pdf[channel] = self.wavelengths.sample_pdf(inside)
        return wavelengths, pdf
