"""Shares of the terms of a mixture at the wavelengths that a ray carries."""

import drjit as dr
import mitsuba as mi


def shares(weights, wavelengths, *, terms: int, nodes: int, low_nm: float, high_nm: float) -> list:
    """Return the first `terms` rows of `weights` (k x nodes, flat) at the ray's wavelengths, a list of spectra."""
    scale = (nodes - 1) / (high_nm - low_nm)
    found = [mi.Spectrum(0.0) for _ in range(terms)]
    for channel in range(len(wavelengths) if terms else 0):
        position = dr.clip((wavelengths[channel] - low_nm) * scale, 0, nodes - 1)
        node = dr.minimum(mi.UInt32(position), nodes - 2)
        fraction = position - mi.Float(node)
        for term, share in enumerate(found):
            left = dr.gather(mi.Float, weights, term * nodes + node)
            right = dr.gather(mi.Float, weights, term * nodes + node + 1)
            share[channel] = dr.lerp(left, right, fraction)
    return found
