"""Mixture of tabulated phase functions whose shares may depend on wavelength."""

import drjit as dr
import mitsuba as mi
import numpy as np

from uwsim.render import phase_tables, spectral_shares

_HALF = int(np.searchsorted(phase_tables.edges()[0], 0.5)) - 1  # bins from here on are told by 1 - s


class TabulatedMixture(mi.PhaseFunction):
    """Sum of terms w_k(lambda) p_k, each p_k piecewise linear in s = sin^2(angle / 2) (see `phase_tables`).

    | parameter | type | meaning |
    |---|---|---|
    | `left`, `right` | (1, k, BINS) tensor | density of each term at both ends of each bin [1/sr] |
    | `weights` | (1, k, n) tensor | share of each term at n equal steps of wavelength, columns sum to 1 |
    | `wavelength_min`, `wavelength_max` | float | first and last wavelength of `weights` [nm] |

    A term is drawn by its share averaged over the wavelengths that the ray carries, so the density used for
    sampling is the mean of the phase function over them. The angle between two directions is taken from the
    distance of their tips, which keeps its digits at small angles; their dot product does not.
    """

    def __init__(self, props):
        super().__init__(props)
        left, right, weights = (np.array(props[name])[0].astype(float) for name in ("left", "right", "weights"))
        self.terms, self.nodes = weights.shape
        self.low, self.high = props["wavelength_min"], props["wavelength_max"]
        if left.shape != (self.terms, phase_tables.BINS) or right.shape != left.shape:
            raise ValueError(f"tabulated_mixture: got left {left.shape}, right {right.shape}, allowed: (k, BINS)")
        s, rest = phase_tables.edges()
        width = phase_tables.widths()
        drawn = [phase_tables.alias_table((low + high) * width) for low, high in zip(left, right, strict=True)]
        self.edge = _floats(np.where(np.arange(len(width)) < _HALF, s[:-1], rest[:-1]))
        self.width = _floats(width)
        self.left = _floats(left)
        self.slope = _floats((right - left) / width)
        self.own = _floats([own for own, _ in drawn])
        self.other = mi.UInt32(np.ravel([other for _, other in drawn]).astype(np.uint32))
        self.weights = _floats(weights)
        self.m_flags = int(mi.PhaseFunctionFlags.Anisotropic)

    def traverse(self, callback):
        for name in ("edge", "width", "left", "slope", "own", "other", "weights"):
            callback.put(name, getattr(self, name), mi.ParamFlags.NonDifferentiable)

    def _shares(self, wavelengths):
        """Return the shares of all terms at the ray's wavelengths, a list of spectra."""
        found = spectral_shares.shares(
            self.weights, wavelengths, terms=self.terms - 1, nodes=self.nodes, low_nm=self.low, high_nm=self.high
        )
        return [*found, mi.Spectrum(1.0) - sum(found, mi.Spectrum(0.0))]

    def _density(self, shares, index, offset):
        """Phase function at an offset in s from the left edge of a bin, a spectrum [1/sr]."""
        value = mi.Spectrum(0.0)
        for term, share in enumerate(shares):
            at = term * phase_tables.BINS + index
            value += share * dr.fma(dr.gather(mi.Float, self.slope, at), offset, dr.gather(mi.Float, self.left, at))
        return value

    def sample(self, ctx, mei, sample1, sample2, active=True):
        shares = self._shares(mei.wavelengths)
        # term by inversion of the cumulative shares; `sample1` is then stretched and used again
        chosen, before, share, cumulative = mi.UInt32(0), mi.Float(0.0), dr.mean(shares[0]), mi.Float(0.0)
        for term in range(1, self.terms):
            cumulative += dr.mean(shares[term - 1])
            beyond = sample1 >= cumulative
            chosen = dr.select(beyond, term, chosen)
            before = dr.select(beyond, cumulative, before)
            share = dr.select(beyond, dr.mean(shares[term]), share)
        stretched = (sample1 - before) / share

        # bin by its column of the alias table; what `sample2.x` has left gives the place within it
        place = sample2.x * phase_tables.BINS
        index = dr.minimum(mi.UInt32(place), phase_tables.BINS - 1)
        place = dr.minimum(place - mi.Float(index), 1)
        column = chosen * phase_tables.BINS + index
        other = stretched >= dr.gather(mi.Float, self.own, column)
        index = dr.select(other, dr.gather(mi.UInt32, self.other, column), index)

        # inverse of the CDF of a density that rises linearly from `low` to `high`
        column = chosen * phase_tables.BINS + index
        width = dr.gather(mi.Float, self.width, index)
        low = dr.gather(mi.Float, self.left, column)
        high = dr.maximum(dr.fma(dr.gather(mi.Float, self.slope, column), width, low), 0)
        root = dr.sqrt(dr.lerp(dr.square(low), dr.square(high), place))
        offset = dr.minimum(place * (low + high) / (low + root), 1) * width

        edge, forward = dr.gather(mi.Float, self.edge, index), index < _HALF
        nearer = dr.clip(dr.select(forward, edge + offset, edge - offset), 0, 1)  # s or 1 - s
        cos_angle = dr.select(forward, 1 - 2 * nearer, 2 * nearer - 1)
        sin_angle = 2 * dr.sqrt(nearer * (1 - nearer))
        sin_phi, cos_phi = dr.sincos(dr.two_pi * sample2.y)
        # mei.wi points back to where the ray came from: forward scattering is -wi
        wo = -mei.to_world(mi.Vector3f(sin_angle * cos_phi, sin_angle * sin_phi, cos_angle))
        value = self._density(shares, index, offset)
        pdf = dr.mean(value)
        return wo, value / pdf, pdf

    def eval_pdf(self, ctx, mei, wo, active=True):
        turned, opposite = dr.squared_norm(wo + mei.wi), dr.squared_norm(wo - mei.wi)
        ratio = dr.maximum(turned, 1e-30) / dr.maximum(opposite, 1e-30)
        place = (dr.log(ratio) - phase_tables.FIRST) * (1 / phase_tables.STEP)
        index = mi.UInt32(dr.clip(dr.floor(place) + 1, 0, phase_tables.BINS - 1))
        edge, whole = dr.gather(mi.Float, self.edge, index), dr.rcp(turned + opposite)
        offset = dr.select(index < _HALF, turned * whole - edge, edge - opposite * whole)
        value = self._density(self._shares(mei.wavelengths), index, offset)
        return value, dr.mean(value)

    def to_string(self):
        return f"TabulatedMixture[terms={self.terms}, nodes={self.nodes}]"


def _floats(values):
    return mi.Float(np.ravel(values).astype(np.float32))


mi.register_phase("tabulated_mixture", lambda props: TabulatedMixture(props))
