"""What the benchmark of poses sees of a body: corners of markers, or spheres, found in its picture or in a mended one.

Spheres bear no name. They are told apart by the place where each is in truth (`labels="truth"`: pairs of least
distance, up to a radius), as markers were by hand in the dissertation; or by `uwsim.pose.correspondence.search` with
nothing of the truth (`labels="search"`). A body that turns into itself is found by that only up to these turns, of
which no picture tells one from another: the one nearest to the truth is taken.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from uwsim.bench import restoration, runner
from uwsim.bench.blur.estimates import Refusal, estimated
from uwsim.bench.markers import camera_from_body, corner_covariances, found_markers
from uwsim.bench.task import Case, lens_of, pinhole_K, pinhole_points
from uwsim.bench.undone import undone
from uwsim.camera.lens import Lens
from uwsim.dataset.frame import Frame
from uwsim.discovery import find
from uwsim.motion_blur import deconvolvers, estimators
from uwsim.motion_blur.undo import one_blur
from uwsim.pose.correspondence import Match, nearest, search, symmetries
from uwsim.pose.spheres import detect_spheres
from uwsim.restoration import algorithms

WORKING_M = (0.15, 1.5)
"""Spheres are looked for of the sizes that they have at these distances."""
LEAST_SPHERES = 4
_WITHIN_PX = 3.0
_SEARCH_WITHIN_PX = 6.0
_UNKNOWN_PX2 = 0.25
"""Variance of a corner whose edges tell none."""


class How(NamedTuple):
    """What the pictures pass before detection, by the files' names, and how spheres are told apart."""

    restored_by: str | None = None
    deblurred_by: str | None = None
    blur_from: str | None = None
    labels: Literal["truth", "search"] = "truth"


@dataclass(frozen=True)
class Points:
    """Points in the body's frame (n, 3) [m], in the image and their true places (n, 2) [px], covariances (n, 2, 2).

    `spare`: how many more were found that are none of the body's. `right`: share of the points found that are what they
    are taken for; NaN where nothing was found.
    """

    body_m: np.ndarray
    image_px: np.ndarray
    true_px: np.ndarray
    covariance_px2: np.ndarray
    spare: int = 0
    right: float = np.nan

    @property
    def squares(self) -> np.ndarray:
        """Squared distances (n,) from the true places in standard deviations; NaN where these are not known."""
        off = self.image_px - self.true_px
        return np.einsum("ni,nij,nj->n", off, np.linalg.inv(self.covariance_px2), off)


@dataclass(frozen=True)
class View:
    """A body with markers in one frame, with its true pose; markers are detected when first asked for."""

    frame: Frame
    body: str
    kept: dict = field(default_factory=dict)

    @cached_property
    def lens(self) -> Lens:
        return lens_of(self.frame)

    @cached_property
    def camera_from_body(self) -> np.ndarray:
        """Return the true pose at mid-exposure, (4, 4) [m]."""
        return camera_from_body(self.frame, self.body)

    @property
    def detected(self) -> Points:
        """Points found in the picture as it is."""
        return self.found(How())

    def found(self, how: How) -> Points:
        """Return the points found in the picture that `how` makes; `true_px` NaN where one is not in view."""
        if how not in self.kept:
            self.kept[how] = self._spheres_found(how) if self.spheres else self._corners_found(how)
        return self.kept[how]

    @cached_property
    def visible(self) -> Points:
        """The visible points, at their true places."""
        if self.spheres:
            shown = [point for point in self.spheres if point.visible]
            return _points([p.point_body_m for p in shown], *[[p.point_px for p in shown]] * 2)
        markers = [marker for marker in self._markers() if any(marker.visible)]
        shown = [np.array(marker.visible) for marker in markers]
        body = [np.array(marker.corners_body_m)[keep] for marker, keep in zip(markers, shown, strict=True)]
        true = [np.array(marker.corners_px)[keep] for marker, keep in zip(markers, shown, strict=True)]
        return _points(body, true, true)

    @cached_property
    def spheres(self) -> list:
        """The spheres of the body, seen or not; empty for a body of another kind."""
        return [point for point in self.frame.info.points if point.body == self.body and point.kind == "sphere"]

    def normalised(self, points_px: np.ndarray) -> np.ndarray:
        """Return pixels (n, 2) as points on the plane z = 1 of the pinhole that the camera is taken for."""
        return pinhole_points(points_px, self.lens)

    def picture(self, how: How) -> np.ndarray:
        """Return the picture, deblurred and restored as asked, (H, W, 3) uint8 sRGB."""
        key = (how.deblurred_by, how.blur_from, how.restored_by)
        if key not in self.kept:
            image = self.frame.image
            if how.deblurred_by is not None:
                image = _deblurred(self.frame, image, how)
            if how.restored_by is not None:
                image = _restored(self.frame, image, how.restored_by)
            self.kept[key] = image
        return self.kept[key]

    def _markers(self) -> list:
        return [marker for marker in self.frame.info.markers if marker.body == self.body]

    def _corners_found(self, how: How) -> Points:
        markers, image = self._markers(), self.picture(how)
        found = found_markers(image, markers)
        covariances = corner_covariances(image, found)
        seen = [marker for marker in markers if (marker.dictionary, marker.id) in found]
        seen = [m for m in seen if np.all(np.isfinite(self.normalised(found[m.dictionary, m.id])))]
        points = _points(
            [marker.corners_body_m for marker in seen],
            [found[marker.dictionary, marker.id] for marker in seen],
            [marker.corners_px or np.full((4, 2), np.nan) for marker in seen],
            [covariances[marker.dictionary, marker.id] for marker in seen],
        )
        known = np.all(np.isfinite(points.covariance_px2), axis=(1, 2))
        points.covariance_px2[~known] = _UNKNOWN_PX2 * np.eye(2)
        return points

    def _spheres_found(self, how: How) -> Points:
        radius_m = self.spheres[0].radius_m
        focal_px = pinhole_K(self.lens)[0, 0]
        image = self.picture(how)
        most = min(focal_px * radius_m / WORKING_M[0], min(image.shape[:2]) / 6)
        sizes = (min(focal_px * radius_m / WORKING_M[1], most), most)
        key = ("spheres", how.deblurred_by, how.blur_from, how.restored_by)
        if key not in self.kept:
            self.kept[key] = detect_spheres(image, radius_px=sizes, lens=self.lens, radius_m=radius_m)
        found = [one for one in self.kept[key] if np.all(np.isfinite(self.normalised(one.centre_px)))]
        body_m = np.array([point.point_body_m for point in self.spheres])
        true_px = np.array([point.point_px or (np.nan, np.nan) for point in self.spheres], float)
        seen_px = np.reshape([one.centre_px for one in found], (-1, 2))
        within = max([_WITHIN_PX, *(one.radius_px for one in found)])
        by_place = nearest(true_px, seen_px, within=within)
        searched = how.labels == "search"
        match = self._searched(body_m, true_px, seen_px, focal_px) if searched else by_place
        named = set(zip(by_place.body.tolist(), by_place.seen.tolist(), strict=True))
        pairs = list(zip(match.body.tolist(), match.seen.tolist(), strict=True))
        right = 100.0 * sum(pair in named for pair in pairs) / len(pairs) if pairs else np.nan
        return Points(
            body_m[match.body], seen_px[match.seen], true_px[match.body],
            np.reshape([found[at].covariance_px2 for at in match.seen], (-1, 2, 2)),
            spare=len(found) - len(pairs), right=right,
        )  # fmt: skip

    def _searched(self, body_m, true_px, seen_px, focal_px: float) -> Match:
        none = Match(np.empty(0, int), np.empty(0, int), np.inf)
        if len(seen_px) < LEAST_SPHERES:
            return none
        least = min(5, len(body_m))
        match = search(body_m, self.normalised(seen_px), within=_SEARCH_WITHIN_PX / focal_px, least=least)
        if match is None:
            return none
        turns = symmetries(body_m)
        off = [np.nansum((true_px[turn[match.body]] - seen_px[match.seen]) ** 2) for turn in turns]
        return match._replace(body=turns[int(np.argmin(off))][match.body])


def _deblurred(frame: Frame, image: np.ndarray, how: How) -> np.ndarray:
    """Return the picture less the blur that an estimator finds; as it is where that refuses or sees none."""
    case = Case(name=frame.name, image=image, makers={}, truth=None)
    estimate, _ = estimated(find(estimators, how.blur_from), how.blur_from, (), case)
    if isinstance(estimate, Refusal):
        return image
    module, name = find(deconvolvers, how.deblurred_by), how.deblurred_by
    where = f"pose: {name}: frame {frame.name}"
    return undone(module, name, module.NEEDS, image=image, way=one_blur(estimate), where=where)[0]


def _restored(frame: Frame, image: np.ndarray, name: str) -> np.ndarray:
    module = find(algorithms, name)
    case = Case(name=frame.name, image=image, makers=restoration.makers(frame), truth=None)
    return restoration.restored(module, name, runner.needs(module, name, restoration.TASK.inputs), case)[0]


def _points(body_m: list, image_px: list, true_px: list, covariance_px2: list | None = None) -> Points:
    def stack(parts: list, *shape: int) -> np.ndarray:
        return np.concatenate([np.asarray(part, float).reshape(-1, *shape) for part in [*parts, []]])

    image = stack(image_px, 2)
    covariance = np.tile(np.eye(2), (len(image), 1, 1)) if covariance_px2 is None else stack(covariance_px2, 2, 2)
    right = 100.0 if len(image) else np.nan
    return Points(stack(body_m, 3), image, stack(true_px, 2), covariance, right=right)
