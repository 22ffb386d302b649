"""The formation models' formulas written out as they stand: loops over wavelengths and slabs, no tables.

What `formation.py` is timed against. Each takes a `View` with bare lamps and grey bodies, on the wavelength grid of
61 nodes (trapezoids); `count` wavelengths only, for timing. Returns {layer: (H, W, 3)} in the camera.
"""

import numpy as np

from uwsim.optics.spectrum import WAVELENGTHS_NM

SLABS = 64


def _weights(view) -> np.ndarray:
    trapezoid = np.full(len(WAVELENGTHS_NM), 1.0)
    trapezoid[[0, -1]] = 0.5
    weighted = view.response * trapezoid[:, None]
    return weighted / weighted.sum(axis=0)


def _picked(count) -> range:
    return range(len(WAVELENGTHS_NM) if count is None else count)


def _geometry(view, lamp):
    """Return path lamp-body, irradiance of the surface per intensity."""
    offset = view.points_m - lamp.world_from_lamp[:3, 3]
    path = np.linalg.norm(offset, axis=-1)
    along = np.einsum("hwk,k->hw", offset, lamp.axis) / path
    cosine = np.maximum(-np.einsum("hwk,hwk->hw", view.normals, offset) / path, 0)
    return path, lamp.profile(np.arccos(along), np.zeros_like(path)) / path**2 * cosine


def _in_camera(view, **layers):
    found = {name: layer * view.factor[..., None] for name, layer in layers.items()}
    return found | {"radiance": sum(found.values())}


def _slabs(view, lamp, range_m, origins, directions):
    """Yield for each slab of the rays: distance, its thickness, path to the lamp, irradiance per intensity, beta."""
    step = range_m / SLABS
    for index in range(SLABS):
        s = (index + 0.5) * step
        offset = origins + s[..., None] * directions - lamp.world_from_lamp[:3, 3]
        path = np.linalg.norm(offset, axis=-1)
        along = np.einsum("hwk,k->hw", offset, lamp.axis) / path
        light = lamp.profile(np.arccos(np.clip(along, -1, 1)), np.zeros_like(path)) / path**2
        cosine = -np.einsum("hwk,hwk->hw", offset, directions) / path
        angle = np.arccos(np.clip(cosine, -1, 1))
        terms = [term.density(angle) for term in view.water.phase.terms]
        yield s, step, path, light, terms


def single_scattering(view, *, count=None, range_m=None, origins=None, directions=None):
    """Backscatter of the lamps: sum over slabs of b p I e^(-c (s + r)) / r^2 ds, wavelength by wavelength."""
    range_m = view.range_m if range_m is None else range_m
    origins = view.origins_m if origins is None else origins
    directions = view.directions if directions is None else directions
    weights, water = _weights(view), view.water
    total = np.zeros((*range_m.shape, 3))
    for lamp in view.lamps:
        for s, step, path, light, terms in _slabs(view, lamp, range_m, origins, directions):
            for k in _picked(count):
                density = sum(share[k] * term for share, term in zip(water.phase.weights, terms, strict=True))
                sent = lamp.spectrum[k] * water.scattering[k] * density * light
                value = sent * np.exp(-water.attenuation[k] * (s + path)) * step
                total += value[..., None] * weights[k]
    return total


def direct(view, *, count=None, whole_path=True, camera_path=True):
    """Light of the bodies: albedo / pi I cos / r^2 e^(-c (r + R)), wavelength by wavelength."""
    weights, water = _weights(view), view.water
    total = np.zeros((*view.shape, 3))
    for lamp in view.lamps:
        path, light = _geometry(view, lamp)
        for k in _picked(count):
            length = (path if whole_path else 0) + (view.range_m if camera_path else 0)
            value = view.albedo[..., 0] / np.pi * lamp.spectrum[k] * light * np.exp(-water.attenuation[k] * length)
            total += value[..., None] * weights[k]
    return total


def veiling_light(view):
    """A (3,), the mean of the light scattered once along 9 x 12 rays without end."""
    few = np.ix_(
        *(np.linspace(0, size - 1, n).round().astype(int) for size, n in zip(view.shape, (9, 12), strict=True))
    )
    far = np.full((9, 12), 10 / view.water.attenuation.min())
    a = single_scattering(view, range_m=far, origins=view.origins_m[few], directions=view.directions[few])
    return a.mean(axis=(0, 1))


def beer_lambert(view, *, count=None):
    """J t + A (1 - t)."""
    weights, water, a = _weights(view), view.water, veiling_light(view)
    light = sum(lamp.spectrum for lamp in view.lamps) * water.scattering
    veil = np.zeros((*view.shape, 3))
    for k in _picked(count):
        t = np.exp(-water.attenuation[k] * view.range_m)
        veil += (1 - t)[..., None] * (a * light[k] * weights[k] / (light @ weights))
    return _in_camera(view, direct=direct(view, count=count, whole_path=False), backscatter=veil)


def revised(view, *, count=None):
    """J e^(-beta_D R) + A (1 - e^(-beta_B R)), effective coefficients at the median range."""
    weights, water, a = _weights(view), view.water, veiling_light(view)
    light = sum(lamp.spectrum for lamp in view.lamps)
    range_m = np.median(view.range_m[np.isfinite(view.range_m)])
    betas = []
    for spectrum in (light, light * water.scattering / water.attenuation):
        kept = sum(spectrum[k] * np.exp(-water.attenuation[k] * range_m) * weights[k] for k in range(len(light)))
        betas.append(-np.log(kept / (spectrum @ weights)) / range_m)
    free = direct(view, count=count, whole_path=False, camera_path=False)
    seen, veil = (np.exp(-view.range_m[..., None] * beta) for beta in betas)
    return _in_camera(view, direct=free * seen, backscatter=a * (1 - veil))


def simplified(view, *, count=None):
    """Unscattered direct light and the true integral of the backscatter."""
    return _in_camera(view, direct=direct(view, count=count), backscatter=single_scattering(view, count=count))


def forward(view, *, rule, count=None):
    """Light of the bodies scattered by small angles on its way to the camera (2.32, 2.33), by FFT per range."""
    weights, water = _weights(view), view.water
    loss = rule.media[1].loss[::2]
    height, width = view.shape
    y, x = (2 * np.pi * np.fft.fftfreq(2 * size) / view.pixel_angle_rad for size in (height, width))
    omega = np.hypot(y[:, None], x[None])
    edges = np.geomspace(view.range_m.min(), view.range_m.max() * 1.0001, 9)
    total = np.zeros((height, width, 3))
    for lamp in view.lamps:
        path, light = _geometry(view, lamp)
        for k in _picked(count):
            c, g = water.attenuation[k], loss[k]
            share = np.exp(-g * view.range_m) - np.exp(-c * view.range_m)
            seen = view.albedo[..., 0] / np.pi * lamp.spectrum[k] * light * np.exp(-c * path) * share
            for low, high in zip(edges, edges[1:], strict=False):
                image = seen * ((view.range_m >= low) & (view.range_m < high))
                middle = (low + high) / 2
                spread = float(rule.damping_rad_per_m(np.array(middle), side="camera")) * middle
                whole = np.block([[image, image[:, ::-1]], [image[::-1], image[::-1, ::-1]]])
                blurred = np.fft.ifft2(np.fft.fft2(whole) * np.exp(-spread * omega)).real[:height, :width]
                total += blurred[..., None] * weights[k]
    return total


def simplified_forward(view, *, rule, count=None):
    found = simplified(view, count=count)
    del found["radiance"]
    factor = view.factor[..., None]
    found["forward_scatter"] = forward(view, rule=rule, count=count) * factor
    return found | {"radiance": sum(found.values())}
