"""The axes of a body drawn over the picture: where it is, and where a solver says it is."""

import numpy as np

from uwsim.bench.page.markup import escape, figure, picture
from uwsim.bench.records import Result, role
from uwsim.bench.task import Case
from uwsim.camera.lens import Lens
from uwsim.camera.port import Status

_STEPS = 65
"""Points of a line that are looked at: is any of them in the picture?"""


def pose_figure(case: Case, poses: dict[str, np.ndarray | None], result: Result | None) -> str:
    """Return the frame with the true axes, the points detected, and the axes of one solver; caption and alternative
    text speak of those that are in the picture alone.

    `poses`: camera_from_body (4, 4) per solver, None where it found none. The solver shown is the first that is
    neither do-nothing nor oracle and whose axes are in the picture.
    """
    view = case.truth
    height, width = case.image.shape[:2]
    unit, length_m = width / 400, _axis_length_m(view)

    def ends(pose: np.ndarray) -> np.ndarray | None:
        return _axes_px(pose, view.lens, length_m, width_px=width, height_px=height)

    true = ends(view.camera_from_body)
    found = [name for name, pose in poses.items() if pose is not None and not (result and role(result, name))]
    name, estimated = next(((one, px) for one in found if (px := ends(poses[one])) is not None), (None, None))
    marks = "" if true is None else _true_axes(true, unit)
    for x, y in view.detected.image_px:
        size = f'r="{2.4 * unit:.3f}" stroke-width="{0.9 * unit:.3f}"'
        marks += f'<circle class="corner" cx="{x:.2f}" cy="{y:.2f}" {size}/>'
    if estimated is not None:
        marks += _estimated_axes(estimated, unit)
    overlay = f'<svg viewBox="0 0 {width} {height}" aria-hidden="true">{marks}</svg>'
    words = [f"Frame {case.name}, body {view.body}."]
    if true is None:
        words.append("The true axes are not in the picture.")
    else:
        words.append(f"Wide coloured axes: truth (x red, y green, z blue, {length_m:.2g} m).")
    if name is not None:
        words.append(f"Dashed white: {name}.")
    elif poses:
        words.append("The axes that solvers found are not in the picture." if found else "No solver found a pose.")
    words.append(_rings(len(view.detected.image_px), "sphere" if view.spheres else "corner"))
    alt = _alternative(true is not None, name is not None)
    return figure(
        f'<div class="overlay">{picture(case.image, alt)}{overlay}</div>', "", escape(" ".join(words)), kind="wide"
    )


def _rings(count: int, kind: str) -> str:
    if count == 0:
        return f"No {kind} was detected."
    return f"Rings: the {count} detected {kind}s." if count > 1 else f"Ring: the {kind} detected."


def _alternative(true: bool, estimated: bool) -> str:
    drawn = " and the ".join(word for word, there in (("true", true), ("estimated", estimated)) if there)
    return "Markers under water" + (f" with the {drawn} axes of their body" if drawn else "")


def _axis_length_m(view) -> float:
    corners = view.visible.body_m
    return 0.4 * float(np.linalg.norm(np.ptp(corners, axis=0)))


def _axes_px(pose: np.ndarray, lens: Lens, length_m: float, *, width_px: int, height_px: int) -> np.ndarray | None:
    """Return origin and ends of the axes (4, 2) [px]; None where one has no pixel or no line crosses the picture."""
    points_m = pose[:3, :3] @ (length_m * np.column_stack([np.zeros(3), np.eye(3)])) + pose[:3, 3:]
    pixels, status = lens.project(points_m.T)
    if np.any(status != Status.SEEN):
        return None
    along = np.linspace(0, 1, _STEPS)[:, None, None]
    lines = pixels[0] + along * (pixels[1:] - pixels[0])
    return pixels if np.any(np.all((lines > 0) & (lines < (width_px, height_px)), axis=-1)) else None


def _true_axes(pixels: np.ndarray, unit: float) -> str:
    (x0, y0), *tips = pixels
    lines = []
    for name, (x, y) in zip("xyz", tips, strict=True):
        line = _line(x0, y0, x, y)
        lines.append(f'<path class="halo" {line} stroke-width="{5.2 * unit:.3f}"/>')
        lines.append(f'<path class="{name}" {line} stroke-width="{3.6 * unit:.3f}"/>')
        lines.append(
            f'<text class="{name}" x="{x0 + 1.13 * (x - x0):.2f}" y="{y0 + 1.13 * (y - y0):.2f}" '
            f'font-size="{12 * unit:.2f}" stroke-width="{2 * unit:.2f}" text-anchor="middle" '
            f'dominant-baseline="middle">{name}</text>'
        )
    return "".join(lines)


def _estimated_axes(pixels: np.ndarray, unit: float) -> str:
    (x0, y0), *tips = pixels
    dash = f"{3.2 * unit:.2f} {2.6 * unit:.2f}"
    return "".join(
        f'<path class="guess" {_line(x0, y0, x, y)} stroke-width="{1.3 * unit:.3f}" stroke-dasharray="{dash}"/>'
        for x, y in tips
    )


def _line(x0: float, y0: float, x: float, y: float) -> str:
    return f'd="M{x0:.2f} {y0:.2f}L{x:.2f} {y:.2f}" fill="none" stroke-linecap="round"'
