"""How a model spreads light scattered forwards: G and B of eq. 2.33 for a view, by physics or as given."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uwsim.formation import small_angle
from uwsim.formation.two_paths import Medium, medium
from uwsim.formation.view import View
from uwsim.formation.widened import WidenedLamp
from uwsim.optics.checks import require

_PATHS = 12
_ANGLES = {"source": small_angle.HEMISPHERE_RAD, "camera": small_angle.VIEW_ANGLE_RAD}

Side = Literal["source", "camera"]
"""The path from a lamp or from the surface of the water, or the path to the camera."""


@dataclass(frozen=True, eq=False)
class Spread:
    """c and G of the two paths, `media` = (source, camera), and `damping`: B, None for that of the phase function."""

    view: View
    media: tuple[Medium, Medium]
    damping: float | None

    def damping_rad_per_m(self, range_m: np.ndarray, *, side: Side) -> np.ndarray:
        """Return B at ranges of any shape. [rad/m]"""
        if self.damping is not None:
            return np.full(np.shape(range_m), self.damping)
        weights = self.view.band_light.mean(axis=1)[::2]
        return small_angle.damping_rad_per_m(
            range_m, water=self.view.water, weights=weights, forward_angle_rad=_ANGLES[side]
        )

    def widened(self, index: int, *, farthest_m: float) -> WidenedLamp:
        """Return the scattered field of one of the view's lamps, for paths up to a distance."""
        paths = np.geomspace(min(0.02, farthest_m / 2), farthest_m, _PATHS)
        widths = paths * self.damping_rad_per_m(paths, side="source")
        return WidenedLamp(self.view.lamps[index], paths_m=paths, widths_rad=widths)

    def blur(self, image: np.ndarray) -> np.ndarray:
        """Return an image (H, W, 3) of the bodies with each pixel's light spread by its range, (H, W, 3)."""
        view = self.view
        path = np.where(view.has_body, view.range_m, 0.0)
        damping = self.damping_rad_per_m(path, side="camera")
        return small_angle.blur(image, path, view.pixel_angle_rad, damping_rad_per_m=damping)


def spread(
    view: View, *, spectral: bool, loss_per_m: np.ndarray | None = None, forward_share: float | None = None,
    damping_rad_per_m: float | None = None,
) -> Spread:  # fmt: skip
    """Return the spread of a view; one G and one B for all paths where they are given.

    G: `loss_per_m`, a number or (61,) [1/m]; or c - `forward_share` b. Else by `small_angle.loss_per_m`: a + b_b on the
    way from the lamps, because a surface receives from a hemisphere, and with scattering beyond VIEW_ANGLE_RAD lost on
    the way to the camera. B: `damping_rad_per_m`, else by `small_angle.damping_rad_per_m` with the same angles.
    Raises ValueError for both of loss_per_m and forward_share, for G above c, and for B below 0.
    """
    if loss_per_m is not None and forward_share is not None:
        raise ValueError("got loss_per_m (G) and forward_share, allowed: one of them (G = c - forward_share b)")
    if forward_share is not None:
        share = float(require("forward_share", forward_share, least=0, most=1))
        loss_per_m = view.water.attenuation - share * view.water.scattering
    if loss_per_m is None:
        losses = [small_angle.loss_per_m(view.water, forward_angle_rad=angle) for angle in _ANGLES.values()]
    else:
        losses = [loss_per_m, loss_per_m]
    if damping_rad_per_m is not None:
        damping_rad_per_m = float(require("damping_rad_per_m (B)", damping_rad_per_m, least=0))
    source, camera = (medium(view, loss, spectral=spectral) for loss in losses)
    return Spread(view, (source, camera), damping_rad_per_m)


def mean_attenuation(view: View) -> float:
    """Return the mean over the bands of c, which the dissertation puts in place of B. [1/m]"""
    return float(np.mean(view.band_attenuation))
