"""One frame of a scene with its truth: pictures of light, geometry and motion as arrays."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uwsim import seeds
from uwsim.camera import pinhole, pose
from uwsim.render import accumulate, geometry, selfcheck, transport
from uwsim.render.build import build, exposure_poses, rig_poses
from uwsim.render.film import View, view_of
from uwsim.scene.models import Scene

_NOWHERE_M = 1.0  # distance taken for pixels that see no body
_STEPS_PER_PIXEL = 4  # steps of the exposure per pixel of the longest streak
_SAMPLES_TRANSMISSION = 64

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Rendered:
    """Truth images by the names of the dataset format, and the poses through the exposure."""

    buffers: dict[str, np.ndarray]
    times_s: np.ndarray
    world_from_camera: np.ndarray
    blur: dict | None


def render_frame(
    scene: Scene, *, samples_per_pixel: int, batches: int, seed: int, frame: int, progress: Progress | None = None
) -> Rendered:
    """Render a scene by light transport, with its water-free twin, layers, geometry and motion.

    (seed, frame) name the random streams. Raises ValueError if the samples do not split into batches, or if
    the self-check finds that the water does not act.
    """
    accumulate.check_samples(samples_per_pixel, batches)
    view, water = view_of(scene), scene.water.optical()
    selfcheck.check_medium(scene, seed=seeds.integer(seed, frame, "self-check"))
    middle = rig_poses(scene, np.zeros(1))
    buffers = geometry.geometry(scene, view, world_from_camera=middle[0])
    steps, blur, moving = 1, None, moves(scene)
    if moving:
        flow_start, flow_end = flow(scene, view, buffers["range"])
        # what enters the view during the exposure counts too: as if something were seen everywhere
        everywhere = flow(scene, view, np.where(np.isfinite(buffers["range"]), buffers["range"], _NOWHERE_M))
        steps = max(1, int(np.ceil(_STEPS_PER_PIXEL * _longest(everywhere[1] - everywhere[0]))))
        blur = summarise_blur(flow_end - flow_start, buffers["instance"] > 0)
        buffers |= {"flow_start": flow_start, "flow_end": flow_end}
    times_s, poses = exposure_poses(scene, steps=steps)

    def light(name, built):
        report = None if progress is None else (lambda done, total: progress(name, done, total))
        return transport.layers(
            built, view, samples_per_pixel=samples_per_pixel, batches=batches,
            seed=seeds.integer(seed, frame, name), progress=report,
        )  # fmt: skip

    without_water = build(scene, water=None, rig_poses=poses)
    buffers |= light("radiance", build(scene, water=water, rig_poses=poses))
    buffers["water_free"] = light("water_free", without_water)["radiance"]
    if moving:
        buffers["sharp"] = light("sharp", build(scene, water=water, rig_poses=middle))["radiance"]
    buffers["transmission"] = transport.transmission(
        without_water, view, attenuation=water.attenuation,
        samples_per_pixel=_SAMPLES_TRANSMISSION, seed=seeds.integer(seed, frame, "transmission"),
    )  # fmt: skip
    return Rendered(buffers=buffers, times_s=times_s, world_from_camera=poses, blur=blur)


def moves(scene: Scene) -> bool:
    """Whether the rig moves during the exposure."""
    motion = scene.rig.motion
    return motion is not None and any((*motion.velocity_m_per_s, *motion.rotation_deg_per_s))


def flow(scene: Scene, view: View, range_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements (H, W, 2) [px], x right, y down, from mid-exposure to its start and to its end.

    Of the point that each pixel's centre sees at mid-exposure; 0 where it sees none.
    """
    half = scene.exposure.time_s / 2
    start, middle, end = rig_poses(scene, np.array([-half, 0.0, half]))
    directions = pinhole.ray_directions(view.K, width_px=view.width_px, height_px=view.height_px)
    seen = np.isfinite(range_m)
    points = pose.apply(middle, directions * np.where(seen, range_m, 1.0)[..., None])
    here = pinhole.project(pose.apply(pose.inverse(middle), points), view.K)
    moved = [pinhole.project(pose.apply(pose.inverse(at), points), view.K) - here for at in (start, end)]
    return tuple(np.where(seen[..., None] & np.isfinite(m), m, 0).astype(np.float32) for m in moved)


def _longest(displacement: np.ndarray) -> float:
    return float(np.linalg.norm(displacement, axis=-1).max())


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
