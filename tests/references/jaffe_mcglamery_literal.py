"""Jaffe-McGlamery's corrected formulas written out wavelength by wavelength and slab by slab: slow, without tables.

An independent transcription of eqs. 2.29-2.36 (`uwsim/formation/EQUATIONS.md`) for one bare axisymmetric lamp and grey
bodies. Convolutions by FFT of the picture mirrored on all sides.
"""

import numpy as np
from scipy import special

from uwsim.formation.bands import fine

DEGREES = 128


def layers(view, *, source_loss, camera_loss, source_width, camera_width, slabs: int) -> dict:
    """Return direct, forward_scatter, backscatter (H, W, 3) of a `View`.

    Losses G (61,); widths: functions of the path [m] -> B R [rad]; `slabs` of equal thickness up to the farthest body.
    """
    lamp, (height, width) = view.lamps[0], view.shape
    attenuation, scattering = fine(view.water.attenuation), fine(view.water.scattering)
    source_g, camera_g, power = fine(source_loss), fine(camera_loss), fine(lamp.spectrum)
    omega = mirrored_omega(height, width) / view.pixel_angle_rad
    series = legendre_series(lamp)
    path, narrow, wide, cosine = arriving(lamp, series, view.points_m, view.normals, source_width)
    bins = [(low, high, camera_width((low + high) / 2)) for low, high in range_bins(view.range_m)]
    step = view.range_m.max() / slabs
    places = (np.arange(slabs) + 0.5) * step
    volume = [slab(view, lamp, series, z, step, source_width) for z in places]
    widths = [camera_width(z) for z in places]
    found = {name: np.zeros((height, width, 3)) for name in ("direct", "forward_scatter", "backscatter")}
    for k, weight in enumerate(view.weights):
        c, b, g_s, g_c = attenuation[k], scattering[k], source_g[k], camera_g[k]
        # 2.31 with the scattered field; 2.30 as radiance
        light = narrow * np.exp(-c * path) + wide * (np.exp(-g_s * path) - np.exp(-c * path))
        seen = view.albedo[..., 0] / np.pi * power[k] * light * cosine
        direct = seen * np.exp(-c * view.range_m)
        # 2.32, 2.33
        forward = np.zeros((height, width))
        for low, high, width_rad in bins:
            inside = (view.range_m >= low) & (view.range_m < high)
            share = np.exp(-g_c * view.range_m) - np.exp(-c * view.range_m)
            forward += convolved(seen * share * inside, np.exp(-width_rad * omega))
        # 2.34-2.36
        back = np.zeros((height, width))
        for (z, length, path_z, narrow_z, wide_z, phase), width_rad in zip(volume, widths, strict=True):
            light = narrow_z * np.exp(-c * path_z) + wide_z * (np.exp(-g_s * path_z) - np.exp(-c * path_z))
            sent = power[k] * b * phase[:, :, k] * light * length
            back += sent * np.exp(-c * z)
            back += convolved(sent * (np.exp(-g_c * z) - np.exp(-c * z)), np.exp(-width_rad * omega))
        for name, image in (("direct", direct), ("forward_scatter", forward), ("backscatter", back)):
            found[name] += image[..., None] * weight
    return found


def arriving(lamp, series, points, normals, source_width):
    """Return path, irradiance per intensity without and with the beam widened, and the cosine of incidence."""
    offset = points - lamp.world_from_lamp[:3, 3]
    path = np.linalg.norm(offset, axis=-1)
    along = np.einsum("...k,k->...", offset, lamp.axis) / path
    narrow = lamp.profile(np.arccos(np.clip(along, -1, 1)), np.zeros_like(path)) / path**2
    wide = widened(series, along, source_width(path)) / path**2
    cosine = None if normals is None else np.maximum(-np.einsum("...k,...k->...", normals, offset) / path, 0)
    return path, narrow, wide, cosine


def legendre_series(lamp):
    """Return the coefficients of the beam's series of Legendre's polynomials, (DEGREES,)."""
    nodes, weights = np.polynomial.legendre.leggauss(2 * DEGREES)
    beam = weights * lamp.profile(np.arccos(nodes), np.zeros_like(nodes))
    degrees = np.arange(DEGREES)[:, None]
    return (2 * degrees[:, 0] + 1) / 2 * (special.eval_legendre(degrees, nodes) @ beam)


def widened(series, along, width):
    """Return the beam at cosines, every one spread by its own width."""
    terms = enumerate(series)
    return sum(value * np.exp(-width * degree) * special.eval_legendre(degree, along) for degree, value in terms)


def slab(view, lamp, series, z, step, source_width):
    """Return what a slab at range z needs: its thickness is cut where the body seen begins."""
    points = view.origins_m + z * view.directions
    path, narrow, wide, _ = arriving(lamp, series, points, None, source_width)
    towards = (lamp.world_from_lamp[:3, 3] - points) / path[..., None]
    cosine = np.einsum("...k,...k->...", towards, view.directions)
    phase = fine(view.water.phase.density(cosine.ravel())).reshape(*cosine.shape, -1)
    length = np.clip(view.range_m - (z - step / 2), 0, step)
    return z, length, path, narrow, wide, phase


def range_bins(ranges, ratio=1.1):
    """Return ranges in slabs that are 10 % thick, [(from, to), ...]."""
    count = int(np.ceil(np.log(ranges.max() * 1.0001 / ranges.min()) / np.log(ratio)))
    edges = ranges.min() * ratio ** np.arange(count + 1)
    return list(zip(edges[:-1], edges[1:], strict=True))


def mirrored_omega(height, width):
    y, x = (2 * np.pi * np.fft.fftfreq(2 * size) for size in (height, width))
    return np.hypot(y[:, None], x[None])


def convolved(image, modulation):
    """Return the convolution of an image, mirrored beyond its edges, by its transform."""
    height, width = image.shape
    whole = np.block([[image, image[:, ::-1]], [image[::-1], image[::-1, ::-1]]])
    return np.fft.ifft2(np.fft.fft2(whole) * modulation).real[:height, :width]
