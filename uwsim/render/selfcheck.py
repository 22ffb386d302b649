"""Refuse to render when the water does not act: exp(-c r) on a white target must come out.

Three mistakes make clear water without a warning: a sensor without its medium, a medium on the wrong side of a
port, an integrator that ignores the medium around the sensor. This check goes through the same medium,
integrator and film as the image.
"""

import dataclasses

import numpy as np

from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean
from uwsim.optics.water import Water
from uwsim.render import transport
from uwsim.render.build import Built, integrator_description, load_medium
from uwsim.render.transport import View

_SIZE_PX = 8
_SAMPLES = 2048
_TOLERANCE = 0.02  # model tolerance: float32 transport


def check_medium(view: View, water: Water, *, integrator: str, seed: int) -> None:
    """Raise ValueError unless a glowing white target is dimmed by exp(-c r), in every band.

    All attenuation is made absorption for the check, so that exp(-c r) is exact. The distance is where the
    average over response and wavelengths keeps about half of its light.
    """
    if not np.any(water.attenuation > 0):
        return
    mean_per_m = float(np.mean(band_mean(water.attenuation, view.response)))
    distance_m = 0.7 / max(mean_per_m, 1e-3)
    measured, error = _target(view, water, distance_m=distance_m, integrator=integrator, seed=seed)
    expected = _expected(view, water, distance_m)
    allowed = _TOLERANCE * expected + 5 * error
    if np.any(np.abs(measured - expected) > allowed):
        raise ValueError(
            f"self-check: a white target at {distance_m:.3g} m in {water.name} shows "
            f"{_text(measured)} of its light (R, G, B), allowed: exp(-c r) = {_text(expected)} "
            f"+- {_text(allowed)}; the image would be wrong and is refused"
        )


def _expected(view: View, water: Water, distance_m: float) -> np.ndarray:
    """Return the band means of exp(-c r), (3,), c and response interpolated linearly in their tables."""
    fine = np.arange(WAVELENGTHS_NM[0], WAVELENGTHS_NM[-1] + 0.01, 0.25)
    kept = np.exp(-np.interp(fine, WAVELENGTHS_NM, water.attenuation) * distance_m)
    response = np.stack([np.interp(fine, WAVELENGTHS_NM, band) for band in view.response.T], axis=-1)
    return np.trapezoid(kept[:, None] * response, fine, axis=0) / np.trapezoid(response, fine, axis=0)


def _target(view: View, water: Water, *, distance_m: float, integrator: str, seed: int):
    """Return the mean band radiance (3,) of a target of radiance 1 that fills the view, and its standard error."""
    import mitsuba as mi

    absorbing = dataclasses.replace(
        water, name=f"{water.name} (check)", absorption=water.attenuation, scattering=np.zeros_like(water.scattering)
    )
    # a narrow view, so that all rays have the same length to 1e-5
    K = np.array([[1e3, 0, _SIZE_PX / 2], [0, 1e3, _SIZE_PX / 2], [0, 0, 1.0]])
    flat = np.ones(len(WAVELENGTHS_NM)) * (view.response.max(axis=1) > 0)
    narrow = View(_SIZE_PX, _SIZE_PX, K, view.response, importance=flat)
    target = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().translate([0, 0, distance_m]).rotate([1, 0, 0], 180).scale(distance_m),
        "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}},
    }
    description = {"type": "scene", "integrator": integrator_description(integrator), "target": target}
    built = Built(
        scene=mi.load_dict(description, optimize=False),
        medium=load_medium(mi, absorbing),
        world_from_camera=np.eye(4)[None],
    )
    image, _ = transport.radiance(built, narrow, samples_per_pixel=_SAMPLES, batches=2, seed=seed)
    pixels = image.reshape(-1, transport.BANDS).astype(float)
    return pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels))


def _text(values: np.ndarray) -> str:
    return "/".join(f"{value:.3g}" for value in values)
