"""Mixture of Henyey-Greenstein phase functions whose shares may depend on wavelength."""

import drjit as dr
import mitsuba as mi

from uwsim.render import spectral_shares


class HGMixture(mi.PhaseFunction):
    """Sum of terms w_k(lambda) HG(g_k).

    | parameter | type | meaning |
    |---|---|---|
    | `g` | (1, k, 1) tensor | mean cosine of each term, in (-1, 1) |
    | `weights` | (1, k, n) tensor | share of each term at n equal steps of wavelength, columns sum to 1 |
    | `wavelength_min`, `wavelength_max` | float | first and last wavelength of `weights` [nm] |

    A term is drawn by its share averaged over the wavelengths that the ray carries, so the density used for
    sampling is the mean of the phase function over them.
    """

    def __init__(self, props):
        super().__init__(props)
        g, weights = props["g"], props["weights"]
        self.terms, self.nodes = weights.shape[1], weights.shape[2]
        self.low, self.high = props["wavelength_min"], props["wavelength_max"]
        self.g = mi.Float(g.array)
        self.weights = mi.Float(weights.array)
        self.m_flags = int(mi.PhaseFunctionFlags.Anisotropic)

    def traverse(self, callback):
        callback.put("g", self.g, mi.ParamFlags.NonDifferentiable)
        callback.put("weights", self.weights, mi.ParamFlags.NonDifferentiable)

    def _shares(self, wavelengths):
        """Return the shares of all terms at the ray's wavelengths, a list of spectra."""
        nodes = {"nodes": self.nodes, "low_nm": self.low, "high_nm": self.high}
        return spectral_shares.shares(self.weights, wavelengths, terms=self.terms, **nodes)

    def _density(self, shares, cos_angle):
        """Phase function at the cosine of the scattering angle, a spectrum [1/sr]."""
        value = mi.Spectrum(0.0)
        for term, share in enumerate(shares):
            g = dr.gather(mi.Float, self.g, mi.UInt32(term))
            # |1 - g|^2 + 2 g (1 - cos) keeps its digits at small angles, 1 + g^2 - 2 g cos does not
            base = dr.square(1 - g) + 2 * g * (1 - cos_angle)
            value += share * ((1 - dr.square(g)) * dr.inv_four_pi / (base * dr.sqrt(base)))
        return value

    def sample(self, ctx, mei, sample1, sample2, active=True):
        shares = self._shares(mei.wavelengths)
        # term by inversion of the cumulative shares; `sample1` is then stretched and used again
        chosen, cumulative = mi.UInt32(0), mi.Float(0.0)
        for term in range(self.terms - 1):
            cumulative += dr.mean(shares[term])
            chosen = dr.select(sample1 >= cumulative, term + 1, chosen)
        g = dr.gather(mi.Float, self.g, chosen)

        square = (1 - dr.square(g)) / (1 - g + 2 * g * sample2.x)
        anisotropic = (1 + dr.square(g) - dr.square(square)) / (2 * g)
        cos_angle = dr.clip(dr.select(dr.abs(g) < 1e-4, 1 - 2 * sample2.x, anisotropic), -1, 1)
        sin_angle = dr.safe_sqrt(1 - dr.square(cos_angle))
        sin_phi, cos_phi = dr.sincos(dr.two_pi * sample2.y)
        # mei.wi points back to where the ray came from: forward scattering is -wi
        wo = -mei.to_world(mi.Vector3f(sin_angle * cos_phi, sin_angle * sin_phi, cos_angle))
        value = self._density(shares, cos_angle)
        pdf = dr.mean(value)
        return wo, value / pdf, pdf

    def eval_pdf(self, ctx, mei, wo, active=True):
        value = self._density(self._shares(mei.wavelengths), -dr.dot(wo, mei.wi))
        return value, dr.mean(value)

    def to_string(self):
        return f"HGMixture[terms={self.terms}, nodes={self.nodes}]"


mi.register_phase("hg_mixture", lambda props: HGMixture(props))
