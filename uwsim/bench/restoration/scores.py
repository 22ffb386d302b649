"""Scores of a restored picture: against the truth as a picture, on charts, and for the task that comes next."""

import math

import numpy as np

from uwsim.bench.markers import camera_from_body, found_markers
from uwsim.bench.restoration.targets import Targets, grey
from uwsim.bench.task import lens_of, pinhole_points
from uwsim.metrics import colour, contrast, edge, features, gain, uciqe, uiqm
from uwsim.metrics import image as image_metrics
from uwsim.metrics import pose as pose_metrics
from uwsim.pose.solvers import opencv_sqpnp

TAG_WITHIN_PX = 3.0


def no_reference_scores(picture: np.ndarray) -> dict[str, float]:
    """Return the scores that see the picture alone, (H, W, 3) uint8 sRGB. White noise ranks high in all: no goals."""
    return {"uciqe_o": uciqe.uciqe_o(picture), "uiqm_f": uiqm.uiqm_f(picture), "uiqm_m": uiqm.uiqm_m(picture)}


def picture_scores(truth: np.ndarray, picture: np.ndarray) -> dict[str, float]:
    """Return PSNR, MSE and SSIM of an 8-bit picture against the reference, and the scores that see it alone."""
    return {
        "psnr": image_metrics.psnr(truth, picture),
        "mse": image_metrics.mse(truth, picture),
        "ssim": image_metrics.ssim(truth, picture),
        **no_reference_scores(picture),
    }


def all_scores(targets: Targets, picture: np.ndarray) -> dict[str, float]:
    """Return every score of a restored picture, (H, W, 3) uint8 sRGB, but the time and those among algorithms.

    `_gain`: of the picture after one gain for all bands, fitted to the truth in linear light (`metrics.gain`).
    """
    gained = gain.with_gain(targets.twin, picture)
    return {
        **picture_scores(targets.twin, picture),
        "psnr_gain": image_metrics.psnr(targets.twin, gained),
        "ssim_gain": image_metrics.ssim(targets.twin, gained),
        "colour_difference": colour.colour_difference(targets.twin, picture, targets.patches),
        "colour_difference_gain": colour.colour_difference(targets.twin, gained, targets.patches),
        **chart_scores(targets, picture),
        **tag_scores(targets, picture),
        "sift_matches": features.verified_percent(targets.sift, features.features(picture, "sift")),
        "orb_matches": features.verified_percent(targets.orb, features.features(picture, "orb")),
    }


def chart_scores(targets: Targets, picture: np.ndarray) -> dict[str, float]:
    """Return the contrast transfer on slanted edges and USAF charts, the mean where there are several; else NaN.

    `mtf50_ratio`: the frequency at which the transfer is one half over that of the truth, along the same edge; above 1
    only where the truth is less sharp than pixels can show, and the restoration sharper. 0 where the edge is lost in
    noise. `usaf_transfer`: `metrics.contrast.chart_transfer`.
    """
    brightness = grey(picture)
    ratios = [edge.mtf50(brightness, one) / true for one, true in targets.edges]
    transfers = [contrast.chart_transfer(brightness, targets.grey, inside=inside) for inside in targets.usaf_charts]
    return {"mtf50_ratio": _mean(ratios), "usaf_transfer": _mean(transfers)}


def tag_scores(targets: Targets, picture: np.ndarray) -> dict[str, float]:
    """Return how the markers are found whose corners are all visible; NaN where there is nothing to measure.

    `tags_found` [%]: detected with the right id, and all corners within 3 px of the truth. `corner_error_px`: root mean
    square over the corners of these: who finds fewer finds the easier ones. `tag_pose_error_percent`: error of the
    camera's place to the body (the mean where there are several) by SQPnP from these corners, with the pinhole of
    `bench.task`: behind a port not quite the camera's geometry, so not 0 for the truth itself.
    """
    if not targets.markers:
        return dict.fromkeys(("tags_found", "corner_error_px", "tag_pose_error_percent"), math.nan)
    detected = found_markers(picture, targets.markers)
    found = []
    for marker in targets.markers:
        corners = detected.get((marker.dictionary, marker.id))
        if corners is not None and np.all(_errors(corners, marker) <= TAG_WITHIN_PX):
            found.append((marker, corners))
    errors = [_errors(corners, marker) for marker, corners in found]
    return {
        "tags_found": 100 * len(found) / len(targets.markers),
        "corner_error_px": float(np.sqrt(np.mean(np.square(errors)))) if found else math.nan,
        "tag_pose_error_percent": _mean([_pose_error(targets, body, found) for body in {m.body for m, _ in found}]),
    }


def _errors(corners: np.ndarray, marker) -> np.ndarray:
    return pose_metrics.corner_error_px(corners, np.array(marker.corners_px))


def _pose_error(targets: Targets, body: str, found: list) -> float:
    corners_px = np.concatenate([corners for marker, corners in found if marker.body == body])
    corners_m = np.concatenate([np.array(marker.corners_body_m) for marker, _ in found if marker.body == body])
    solution = opencv_sqpnp.solve(corners_m[None], pinhole_points(corners_px, lens_of(targets.frame))[None])
    if not solution.ok[0]:
        return math.nan
    true_m = camera_from_body(targets.frame, body)[:3, 3]
    return float(pose_metrics.translation_error_percent(solution.translation_m[0], true_m))


def _mean(values: list[float]) -> float:
    known = sorted(value for value in values if not math.isnan(value))
    return math.fsum(known) / len(known) if known else math.nan
