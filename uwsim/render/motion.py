"""What motion of rig and bodies does to the image: displacements of what is seen, and how finely to follow them."""

import dataclasses

import numpy as np

from uwsim.camera import pose
from uwsim.camera.lens import pixel_centres
from uwsim.camera.shutter import see
from uwsim.render.film import View
from uwsim.render.shapes import body_points
from uwsim.scene.bodies import numbered
from uwsim.scene.models import Scene

_NOWHERE_M = 1.0  # distance taken for pixels that see no body
_STEPS_PER_PIXEL = 4  # steps of the exposure per pixel of the longest streak
_STEPS_PER_PIXEL_BY_ROWS = 16  # finer, as a row sees a part of the steps only
_TIMES = 65
_GRID_PX = 64  # pixels per side whose points are followed along a path
_SUB_FRAMES_PER_PIXEL = 4  # parts of the exposure per pixel of the longest streak of a moving body
_LEAST_SUB_FRAMES = 8  # for what does not show as a streak: shadows, bodies that are seen later
MOST_SUB_FRAMES = 2048


def flow(
    scene: Scene, view: View, range_m: np.ndarray, instance: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements (H, W, 2) [px], x right, y down, from mid-exposure to its start and to its end.

    Of the point that each pixel's centre sees in the middle of its row's exposure, moving with its body; 0 where it
    sees none. `instance` (H, W): the numbers of the bodies, needed where one moves. With a rolling shutter start and
    end are those of the row in which the point is seen then.
    """
    if scene.moving_bodies and instance is None:
        raise ValueError("flow: got no instance buffer of a scene with moving bodies, allowed: with it")
    points = _points(scene, view, range_m)
    seen = np.isfinite(range_m)
    moments = {"lens": view.lens, "poses_at": scene.rig.poses_at, "shutter": view.shutter}
    here = see(points, **moments)[0]
    moved = []
    for phase in (-0.5, 0.5):
        then = _moved(scene, points, instance, phase * view.shutter.exposure_s) if scene.moving_bodies else points
        moved.append(see(then, phase=phase, **moments)[0] - here)
    return tuple(np.where(seen[..., None] & np.isfinite(m), m, 0).astype(np.float32) for m in moved)


def _moved(scene: Scene, points: np.ndarray, instance: np.ndarray, time_s: float) -> np.ndarray:
    """Return where points (H, W, 3) that the pixels see at mid-exposure have gone with their bodies at another time."""
    result = points.copy()
    for number, body in numbered(scene.bodies):
        if body.moves:
            then_from_middle = body.poses_at(np.array([time_s]))[0] @ pose.inverse(body.world_from_body)
            result[instance == number] = pose.apply(then_from_middle, points[instance == number])
    return result


def _points(scene: Scene, view: View, range_m: np.ndarray) -> np.ndarray:
    """Return the points (H, W, 3) [m] in the world that the pixels' centres see, at 1 m where `range_m` is infinite."""
    origins, directions = view.lens.rays(pixel_centres(width_px=view.width_px, height_px=view.height_px))
    points = origins + directions * np.where(np.isfinite(range_m), range_m, _NOWHERE_M)[..., None]
    if view.shutter.readout_s == 0:
        return pose.apply(scene.rig.world_from_rig, points)
    return pose.apply_each(scene.rig.poses_at(view.shutter.row_middles_s())[:, None], points)


def exposure_steps(scene: Scene, view: View, range_m: np.ndarray) -> int:
    """Return into how many equal steps to divide the rig's way through the exposure, so that none shows in the image.

    What enters the view during the exposure counts too: as if something were seen in every pixel.
    """
    everywhere = np.where(np.isfinite(range_m), range_m, _NOWHERE_M)
    if scene.rig.trajectory is None and view.shutter.readout_s == 0:
        at_rest = scene.model_copy(update={"bodies": ()})
        start, end = flow(at_rest, view, everywhere)
        return max(1, int(np.ceil(_STEPS_PER_PIXEL * _longest(end - start))))
    per_pixel = _STEPS_PER_PIXEL_BY_ROWS if view.shutter.readout_s > 0 else _STEPS_PER_PIXEL
    return max(1, int(np.ceil(per_pixel * _fastest_px_per_s(scene, view, everywhere) * view.shutter.span_s)))


def _longest(displacement: np.ndarray) -> float:
    return float(np.linalg.norm(displacement, axis=-1).max())


def _fastest_px_per_s(scene: Scene, view: View, range_m: np.ndarray) -> float:
    """Return how fast the rig makes something move through the image at most."""
    stride = tuple(slice(None, None, max(1, size // _GRID_PX)) for size in range_m.shape)
    points = _points(scene, view, range_m)[stride].reshape(-1, 3)
    times_s = _times_s(view, [scene.rig.trajectory])
    poses = scene.rig.poses_at(times_s)
    return _fastest(view, times_s, [pose.apply(pose.inverse(at), points) for at in poses])


def _times_s(view: View, trajectories: list) -> np.ndarray:
    """Return times that cover the exposure, those at which a path bends among them."""
    half_s = view.shutter.span_s / 2
    times_s = np.linspace(-half_s, half_s, _TIMES)
    for trajectory in trajectories:
        if trajectory is not None:
            knots_s = np.array(trajectory.times_s)
            times_s = np.union1d(times_s, knots_s[np.abs(knots_s) < half_s])
    return times_s


def _fastest(view: View, times_s: np.ndarray, local_points: list[np.ndarray]) -> float:
    """Return how fast points (n, 3) in the camera's frame, one set per time, move through the image at most [px/s]."""
    fastest, before = 0.0, None
    for index, points in enumerate(local_points):
        pixels = view.lens.project(points)[0]
        inside = np.all((pixels >= 0) & (pixels <= (view.width_px, view.height_px)), axis=-1)
        if before is not None:
            path_px = np.linalg.norm(pixels - before[0], axis=-1)
            counted = path_px[(inside | before[1]) & np.isfinite(path_px)]
            fastest = max(fastest, counted.max(initial=0.0) / (times_s[index] - times_s[index - 1]))
        before = pixels, inside
    return fastest


def sub_frames(scene: Scene, view: View) -> int:
    """Return into how many equal parts to divide the exposure, in each of which the bodies are held still.

    At least four for each pixel of the longest streak of a point of a moving body, as seen from the moving rig and as
    from a rig at rest (where both move alike nothing streaks, yet a body held still would); 1 without moving bodies.
    Raises ValueError if these are too many.
    """
    longest_px, name = 0.0, None
    for body in scene.moving_bodies:
        times_s = _times_s(view, [scene.rig.trajectory, getattr(body, "trajectory", None)])
        points = body_points(body, near_m=scene.rig.world_from_rig[:3, 3])
        world = [pose.apply(at, points) for at in body.poses_at(times_s)]
        held = np.tile(scene.rig.world_from_rig, (len(times_s), 1, 1))
        for poses in (scene.rig.poses_at(times_s), held):
            local = [pose.apply(pose.inverse(at), then) for at, then in zip(poses, world, strict=True)]
            streak_px = _fastest(view, times_s, local) * view.shutter.span_s
            longest_px, name = max((longest_px, name), (streak_px, body.name), key=lambda pair: pair[0])
    if not scene.moving_bodies:
        return 1
    count = max(_LEAST_SUB_FRAMES, int(np.ceil(_SUB_FRAMES_PER_PIXEL * longest_px)))
    if count > MOST_SUB_FRAMES:
        raise ValueError(
            f"body {name}: moves by {longest_px:.4g} px through the image during the exposure, "
            f"allowed: {MOST_SUB_FRAMES // _SUB_FRAMES_PER_PIXEL} px (a shorter exposure or a slower motion)"
        )
    return count


def momentary(scene: Scene, view: View, *, steps: int) -> tuple[View, np.ndarray]:
    """Return the view with an exposure of no length in the middle of each row's, and the poses (n, 4, 4) for it.

    `steps`: those of the exposure itself.
    """
    shutter = dataclasses.replace(view.shutter, exposure_s=0.0)
    if shutter.readout_s == 0:
        times_s = np.zeros(1)
    else:
        times_s = shutter.step_times_s(max(1, int(np.ceil(steps * shutter.readout_s / view.shutter.span_s))))
    return dataclasses.replace(view, shutter=shutter), scene.rig.poses_at(times_s)


def summarise_blur(displacement: np.ndarray, seen: np.ndarray) -> dict | None:
    """Return the `blur` entry of frame.json from start-to-end displacements (H, W, 2); None if nothing is seen.

    Angle: x right, y up, mod 180.
    """
    if not seen.any():
        return None
    median = np.median(displacement[seen], axis=0)
    length = float(np.linalg.norm(median))
    spread = float(np.percentile(np.linalg.norm(displacement[seen] - median, axis=-1), 90))
    return {
        "length_px": length,
        "angle_deg": float(np.degrees(np.arctan2(-median[1], median[0])) % 180.0),
        "spread_px": spread,
        "uniform": spread <= max(0.5, 0.1 * length),
    }
