"""The axes of a body drawn over the picture: where it is, and where a solver says it is."""

import numpy as np

from uwsim.bench.page.markup import escape, figure, picture
from uwsim.bench.records import Result, role
from uwsim.bench.task import Case
from uwsim.camera.lens import Lens
from uwsim.camera.port import Status


def pose_figure(case: Case, poses: dict[str, np.ndarray | None], result: Result | None) -> str:
    """Return the frame with the true axes, the detected corners, and the axes of one solver.

    `poses`: camera_from_body (4, 4) per solver, None where it found none. The solver shown is the first
    that is neither do-nothing nor oracle and found a pose.
    """
    view = case.truth
    estimated = next(
        (name for name, pose in poses.items() if pose is not None and not (result and role(result, name))),
        None,
    )
    length_m = _axis_length_m(view)
    height, width = case.image.shape[:2]
    unit = width / 400
    marks = _axes(view.camera_from_body, view.lens, length_m, unit, true=True)
    for x, y in view.detected.image_px:
        size = f'r="{2.4 * unit:.3f}" stroke-width="{0.9 * unit:.3f}"'
        marks += f'<circle class="corner" cx="{x:.2f}" cy="{y:.2f}" {size}/>'
    if estimated:
        marks += _axes(poses[estimated], view.lens, length_m, unit, true=False)
    overlay = f'<svg viewBox="0 0 {width} {height}" aria-hidden="true">{marks}</svg>'
    words = f"Frame {case.name}, body {view.body}. Wide coloured axes: truth"
    words += f" (x red, y green, z blue, {length_m:.2g} m)."
    words += f" Dashed white: {estimated}." if estimated else " No solver found a pose."
    words += f" Rings: the {len(view.detected.body_m)} detected corners."
    alt = "Markers under water with the true and the estimated axes of their body"
    return figure(f'<div class="overlay">{picture(case.image, alt)}{overlay}</div>', "", escape(words), kind="wide")


def _axis_length_m(view) -> float:
    corners = view.visible.body_m
    return 0.4 * float(np.linalg.norm(np.ptp(corners, axis=0)))


def _axes(pose: np.ndarray, lens: Lens, length_m: float, unit: float, *, true: bool) -> str:
    """Return three lines from the origin of the body; "" where an end is not seen."""
    ends = pose[:3, :3] @ (length_m * np.column_stack([np.zeros(3), np.eye(3)])) + pose[:3, 3:]
    pixels, status = lens.project(ends.T)
    if np.any(status != Status.SEEN):
        return ""
    (x0, *xs), (y0, *ys) = pixels.T
    lines = []
    for name, x, y in zip("xyz", xs, ys, strict=True):
        line = f'd="M{x0:.2f} {y0:.2f}L{x:.2f} {y:.2f}" fill="none" stroke-linecap="round"'
        if true:
            lines.append(f'<path class="halo" {line} stroke-width="{5.2 * unit:.3f}"/>')
            lines.append(f'<path class="{name}" {line} stroke-width="{3.6 * unit:.3f}"/>')
            lines.append(
                f'<text class="{name}" x="{x0 + 1.13 * (x - x0):.2f}" y="{y0 + 1.13 * (y - y0):.2f}" '
                f'font-size="{12 * unit:.2f}" stroke-width="{2 * unit:.2f}" text-anchor="middle" '
                f'dominant-baseline="middle">{name}</text>'
            )
        else:
            dash = f"{3.2 * unit:.2f} {2.6 * unit:.2f}"
            lines.append(f'<path class="guess" {line} stroke-width="{1.3 * unit:.3f}" stroke-dasharray="{dash}"/>')
    return "".join(lines)
