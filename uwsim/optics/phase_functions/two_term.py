"""Two-term Henyey-Greenstein phase function: a forward and a backward lobe."""

from uwsim.optics import tables
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import Mixture


def two_term(*, share: float, g_forward: float, g_backward: float) -> Mixture:
    """Return share x HG(g_forward) + (1 - share) x HG(g_backward)."""
    if not 0 <= share <= 1:
        raise ValueError(f"two-term phase function: share is {share}, allowed: 0 to 1")
    return Mixture((HenyeyGreenstein(g_forward), HenyeyGreenstein(g_backward)), (share, 1 - share))


def petzold_two_term(water: str) -> Mixture:
    """Return two terms fitted to Petzold's `clear`, `coastal`, `harbor` or `average` particle.

    Source: fit to Petzold 1972.
    Valid: beyond 20 deg, rms 5-11 %; twice the table around 6 deg, and at 1 deg only 0.26-0.86 of it.
    """
    fit = tables.row("petzold_fits", "water", water)
    return two_term(
        share=float(fit["two_term_share"]), g_forward=float(fit["two_term_g1"]), g_backward=float(fit["two_term_g2"])
    )
