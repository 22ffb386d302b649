"""Estimate and truth in, number out. `METRICS` gives unit and better direction of each."""

from typing import Literal, NamedTuple


class Metric(NamedTuple):
    """Name, unit ("" for a pure number) and direction of a score."""

    name: str
    unit: str
    better: Literal["higher", "lower"]


LAYERS = ("direct", "forward_scatter", "backscatter")
"""Layers of light of a picture."""
POSE_PARTS = ("rotation", "translation")

METRICS = {
    metric.name: metric
    for metric in (
        Metric("psnr", "dB", "higher"),
        Metric("mse", "levels^2", "lower"),
        Metric("ssim", "", "higher"),
        Metric("psnr_gain", "dB", "higher"),
        Metric("ssim_gain", "", "higher"),
        Metric("colour_difference", "", "lower"),
        Metric("colour_difference_gain", "", "lower"),
        Metric("mtf50_ratio", "", "higher"),
        Metric("usaf_transfer", "", "higher"),
        Metric("tags_found", "%", "higher"),
        Metric("tag_pose_error_percent", "%", "lower"),
        Metric("sift_matches", "%", "higher"),
        Metric("orb_matches", "%", "higher"),
        Metric("oracle_share", "", "higher"),
        Metric("oracle_share_gain", "", "higher"),
        Metric("uciqe_o", "", "higher"),
        Metric("uiqm_f", "", "higher"),
        Metric("uiqm_m", "", "higher"),
        Metric("length_error_px", "px", "lower"),
        Metric("angle_error_deg", "deg", "lower"),
        Metric("failure_percent", "%", "lower"),
        Metric("length_error_to_bound_ratio", "", "lower"),
        Metric("angle_error_to_bound_ratio", "", "lower"),
        Metric("length_error_to_sd", "", "lower"),
        Metric("angle_error_to_sd", "", "lower"),
        Metric("length_covered_percent", "%", "higher"),
        Metric("angle_covered_percent", "%", "higher"),
        Metric("refused_percent", "%", "lower"),
        Metric("kept_failure_percent", "%", "lower"),
        Metric("sharp_called_blurred_percent", "%", "lower"),
        Metric("field_error_px", "px", "lower"),
        Metric("field_answered_percent", "%", "higher"),
        Metric("psnr_above_blurred", "dB", "higher"),
        Metric("psnr_inner", "dB", "higher"),
        Metric("made_worse_percent", "%", "lower"),
        Metric("left_alone_percent", "%", "lower"),
        Metric("detected_percent", "%", "higher"),
        Metric("rotation_error_deg", "deg", "lower"),
        Metric("translation_error_percent", "%", "lower"),
        Metric("corner_error_px", "px", "lower"),
        Metric("points_found_percent", "%", "higher"),
        Metric("points_right_percent", "%", "higher"),
        Metric("points_covered_percent", "%", "higher"),
        *(Metric(f"{kind}_ratio_to_ml", "", "lower") for kind in POSE_PARTS),
        *(Metric(f"{kind}_ratio_{end}", "", "lower") for kind in POSE_PARTS for end in ("low", "high")),
        *(Metric(f"{kind}_{what}_to_bound_ratio", "", "lower") for kind in POSE_PARTS for what in ("error", "rms")),
        Metric("mean_rotation_error_deg", "deg", "lower"),
        Metric("mean_translation_error_percent", "%", "lower"),
        Metric("fail_percent", "%", "lower"),
        Metric("fail_above_best_known_percent", "%", "lower"),
        Metric("missed_minimum_percent", "%", "lower"),
        Metric("below_best_known_percent", "%", "lower"),
        Metric("no_pose_percent", "%", "lower"),
        Metric("right_percent", "%", "higher"),
        Metric("wrong_percent", "%", "lower"),
        Metric("exact_percent", "%", "higher"),
        Metric("microseconds_per_problem", "us", "lower"),
        Metric("relative_radiance_error", "%", "lower"),
        *(Metric(f"{layer}_error", "%", "lower") for layer in LAYERS),
        *(Metric(f"{layer}_psnr", "dB", "higher") for layer in LAYERS),
        *(Metric(f"{layer}_mse", "levels^2", "lower") for layer in LAYERS),
        Metric("contrast_error", "%", "lower"),
        Metric("psnr_pseudo", "dB", "higher"),
        Metric("ssim_pseudo", "", "higher"),
        Metric("tags_verified", "", "higher"),
        Metric("frames_with_two_tags_percent", "%", "higher"),
        Metric("tags_rejected", "", "lower"),
        Metric("homography_error_px", "px", "lower"),
        Metric("pose_error_px", "px", "lower"),
        Metric("milliseconds", "ms", "lower"),
    )
}
