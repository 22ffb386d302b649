"""One frame of a scene with its truth: pictures of light, geometry and motion as arrays."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uwsim import seeds
from uwsim.render import geometry, memory, placement, selfcheck, smooth, stopping, transport
from uwsim.render.build import build, exposure_poses
from uwsim.render.checkpoint import Checkpoint
from uwsim.render.film import View, view_of
from uwsim.render.motion import exposure_steps, flow, momentary, sub_frames, summarise_blur
from uwsim.render.rounds import Ended, Rounds
from uwsim.scene.models import Scene

_SAMPLES_TRANSMISSION = 64
_NOTHING_MORE = smooth.Options()

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Rendered:
    """Truth images by the names of the dataset format, the poses through the exposure, and how each light picture's
    render `ended`. `sub_frames`: the parts of the exposure in each of which moving bodies were held still; 1: at rest.
    """

    buffers: dict[str, np.ndarray]
    times_s: np.ndarray
    world_from_camera: np.ndarray
    blur: dict | None
    ended: dict[str, Ended]
    sub_frames: int = 1


def render_frame(
    scene: Scene, *, until: stopping.Until, seed: int, frame: int, checkpoint: Checkpoint | None = None,
    progress: Progress | None = None, options: smooth.Options = _NOTHING_MORE,
) -> Rendered:  # fmt: skip
    """Render a scene by light transport, with its water-free twin, layers, geometry and motion.

    (seed, frame) name the random streams. `until` ends the render of each light picture; those pictures' sums are taken
    from `checkpoint` and kept there; `options` as in `render.smooth`. Raises ValueError if the frame does not fit into
    memory, if something is placed where it cannot be (`render.placement`), or if the self-check finds that the water
    does not act. Where bodies move, the samples per batch are raised to a multiple of the sub-frames, as `ended` says.
    """
    view, water = view_of(scene), scene.water.optical()
    memory.require_memory(width_px=view.width_px, height_px=view.height_px, denoise=options.denoise)
    placement.check(scene)
    selfcheck.check_medium(scene, seed=seeds.integer(seed, frame, "self-check"))
    buffers = geometry.geometry(scene, view)
    steps, blur = 1, None
    if scene.moves:
        flow_start, flow_end = flow(scene, view, buffers["range"], buffers["instance"])
        steps = exposure_steps(scene, view, buffers["range"])
        blur = summarise_blur(flow_end - flow_start, buffers["instance"] > 0)
        buffers |= {"flow_start": flow_start, "flow_end": flow_end}
    times_s, poses = exposure_poses(scene, steps=steps)
    parts = sub_frames(scene, view)

    names = ("radiance", "water_free", *(("sharp",) if scene.moves else ()))
    rounds = Rounds(scene, view, until, names=names, checkpoint=checkpoint, progress=progress, options=options)

    at_rest = smooth.Surfaces(albedo=buffers["albedo"], normal=buffers["normal"])
    surfaces = _surfaces(scene, view, poses, at_rest) if options.denoise else None

    def light(name, built, seen=None, of=surfaces):
        return rounds.picture(name, built, seed=seeds.integer(seed, frame, name), view=seen, surfaces=of)

    without_water = build(scene, water=None, rig_poses=poses, sub_frames=parts)
    in_water = build(scene, water=water, rig_poses=poses, sub_frames=parts)
    buffers |= light("radiance", in_water)
    buffers["water_free"] = light("water_free", without_water)["radiance"]
    if scene.moves:
        at_once, middle = momentary(scene, view, steps=steps)
        buffers["sharp"] = light("sharp", build(scene, water=water, rig_poses=middle), at_once, at_rest)["radiance"]
    buffers["transmission"] = transport.transmission(
        without_water, view, attenuation=water.attenuation, added=in_water.added,
        samples_per_pixel=_SAMPLES_TRANSMISSION, seed=seeds.integer(seed, frame, "transmission"),
    )  # fmt: skip
    return Rendered(
        buffers=buffers,
        times_s=times_s,
        world_from_camera=poses,
        blur=blur,
        ended=rounds.ended,
        sub_frames=parts,
    )


def _surfaces(scene: Scene, view: View, poses: np.ndarray, at_rest: smooth.Surfaces) -> smooth.Surfaces | None:
    """Return what the pixels see in the course of the exposure; None where it is not the same poses for all of them."""
    if not scene.moves:
        return at_rest
    if scene.moving_bodies or view.shutter.readout_s > 0:
        return None
    return geometry.mean_surfaces(scene, view, poses)
