"""What a still frame shows that restorations are measured by: charts, edges, markers and features of the truth."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.bench.markers import whole_markers
from uwsim.dataset.frame import Frame
from uwsim.dataset.info import Marker
from uwsim.images import linear_from_srgb_uint8
from uwsim.metrics import colour, edge, features


@dataclass(frozen=True)
class Targets:
    """A frame and its water-free twin, (H, W, 3) uint8 sRGB; each target is looked for once, when first asked for."""

    frame: Frame
    twin: np.ndarray

    @cached_property
    def grey(self) -> np.ndarray:
        return grey(self.twin)

    @cached_property
    def patches(self) -> np.ndarray:
        """The patches of all ColorCheckers, (H, W) int as of `metrics.colour.patches`."""
        inside = np.isin(self.frame.buffer("instance"), self._numbers("colorchecker"))
        return colour.patches(self.frame.buffer("albedo").astype(float), inside)

    @cached_property
    def edges(self) -> list[tuple[edge.Edge, float]]:
        """The slanted edges that the twin shows, each with its `mtf50` there."""
        albedo = self.frame.buffer("albedo")
        found = [edge.find_edge(albedo, inside) for inside in self._seen("slanted_edge")]
        measured = [(one, edge.mtf50(self.grey, one)) for one in found if one is not None]
        return [(one, value) for one, value in measured if value > 0]

    @cached_property
    def usaf_charts(self) -> list[np.ndarray]:
        """Where each USAF chart is seen, (H, W) bool."""
        return self._seen("usaf_1951")

    @cached_property
    def markers(self) -> list[Marker]:
        return whole_markers(self.frame.info)

    @cached_property
    def sift(self) -> features.Features:
        return features.features(self.twin, "sift")

    @cached_property
    def orb(self) -> features.Features:
        return features.features(self.twin, "orb")

    def _numbers(self, kind: str) -> list[int]:
        return [body.instance for body in self.frame.info.bodies if body.kind == kind]

    def _seen(self, kind: str) -> list[np.ndarray]:
        instance = self.frame.buffer("instance")
        masks = [instance == number for number in self._numbers(kind)]
        return [mask for mask in masks if mask.any()]


def grey(picture: np.ndarray) -> np.ndarray:
    """Return the brightness of an 8-bit picture: the mean of the bands in linear light, (H, W)."""
    return linear_from_srgb_uint8(picture).mean(axis=-1, dtype=float)
