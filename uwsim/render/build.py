"""A scene description as Mitsuba objects. The only place that calls `mi.load_dict` on a scene."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uwsim.camera import pose
from uwsim.optics.water import Water
from uwsim.render.phase_tables import phase_description
from uwsim.render.shapes import body_shapes, snow_shape, spectrum, tensor
from uwsim.render.sub_frames import SubFrames
from uwsim.scene.bodies import MarineSnow, numbered
from uwsim.scene.daylight import Daylight
from uwsim.scene.lamp_window import FlatLampWindow
from uwsim.scene.models import Scene
from uwsim.scene.plumes import merged

LEAST_ATTENUATION_PER_M = 1e-6
_TIMES_OF_SNOW = 33  # at which particles in the way of lamps and camera are looked for


@dataclass(frozen=True)
class Built:
    """A loaded scene: `scene` (Mitsuba), poses of the camera, and the `water` around it with its Mitsuba `medium`.

    `water` and `medium` are None where nothing absorbs or scatters. `added` holds the waters on top of it, `housings`
    what shadows and stays black, `daylight` what comes through the surface, `particles` the ids of the shapes that are
    no bodies but large particles, `sub_frames` where the bodies are in the parts of the exposure (None: at rest),
    `glowing` the spectral radiance (a Mitsuba spectrum) of the shapes that shine by themselves, by id.
    """

    scene: Any
    medium: Any
    world_from_camera: np.ndarray
    water: Water | None = None
    added: "Added | None" = None
    housings: Any = None
    daylight: Daylight | None = None
    refractive_index: float = 1.0
    particles: tuple[str, ...] = ()
    sub_frames: SubFrames | None = None
    glowing: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Added:
    """Waters on top of the scene's: their shares (n, nx, ny, nz) in the cells between edges along x, y, z [m]."""

    waters: tuple[Water, ...]
    phases: tuple[Any, ...]
    edges_m: tuple[np.ndarray, ...]
    shares: np.ndarray


def exposure_poses(scene: Scene, *, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) [s], mid-exposure = 0, and world_from_rig (n, 4, 4) at the middle of n equal steps.

    The steps fill the span from the start of the first row's exposure to the end of the last one's.
    """
    times_s = scene.shutter.step_times_s(steps)
    return times_s, rig_poses(scene, times_s)


def rig_poses(scene: Scene, times_s: np.ndarray) -> np.ndarray:
    """Return world_from_rig (n, 4, 4) at times relative to mid-exposure."""
    return scene.rig.poses_at(np.asarray(times_s, float))


def build(scene: Scene, *, water: Water | None, rig_poses: np.ndarray, sub_frames: int = 1) -> Built:
    """Load a scene into the active Mitsuba variant.

    water: what fills the world, None for none (absorption = scattering = 0) and no particles in it.
    rig_poses: world_from_rig (n, 4, 4) through the exposure.
    sub_frames: in how many parts of the exposure bodies in motion stand where they then are; 1: as at mid-exposure.
    """
    import mitsuba as mi

    added = None if water is None else _added(mi, scene)
    medium = load_medium(mi, water, even_if_empty=added is not None)  # an empty scene may have something in it
    description = {"type": "scene", "integrator": integrator_description("path" if medium is None else "volpathmis")}
    for index, lamp in enumerate(scene.rig.lamps):
        description[f"lamp{index}"] = _lamp(mi, lamp, rig_poses, n_water=scene.water.refractive_index)
    snow = {} if water is None else _snow(mi, scene)
    loaded = mi.load_dict(description | _bodies(mi, scene) | snow, optimize=False)
    return Built(
        scene=loaded,
        medium=medium,
        world_from_camera=rig_poses,
        water=None if medium is None else water,
        added=added,
        housings=_housings(mi, scene, rig_poses),
        daylight=scene.daylight,
        refractive_index=scene.water.refractive_index,
        particles=tuple(snow),
        sub_frames=_sub_frames(scene, loaded, count=sub_frames),
        glowing=_glowing(mi, scene),
    )


def _added(mi, scene: Scene) -> Added | None:
    if not scene.added_water:
        return None
    waters = tuple(added.water.optical() for added in scene.added_water)
    edges, shares = merged(scene.added_water)
    media = [load_medium(mi, water) for water in waters]
    return Added(waters, tuple(medium.phase_function() for medium in media), edges, shares)


def _housings(mi, scene: Scene, poses: np.ndarray):
    camera = scene.rig.camera
    fronts = [(camera.rig_from_front, camera.housing, 0.0)]
    fronts += [(lamp.rig_from_front, lamp.housing, lamp.dome_radius_m) for lamp in scene.rig.lamps]
    cylinders = [
        (tensor(mi, (poses @ front)[:, :3, :]), housing.radius_m, housing.length_m, dome_m)
        for front, housing, dome_m in fronts
        if housing is not None
    ]
    if not cylinders:
        return None
    from uwsim.render.housing import Housings

    return Housings(cylinders)


def build_bodies(scene: Scene) -> Any:
    """Load the bodies alone, for casting rays; works in every variant."""
    import mitsuba as mi

    return mi.load_dict({"type": "scene"} | _bodies(mi, scene), optimize=False)


def _bodies(mi, scene: Scene) -> dict:
    return {
        f"body{index}_{part}": shape
        for index, body in numbered(scene.bodies)
        for part, shape in body_shapes(mi, body).items()
    }


def _glowing(mi, scene: Scene) -> dict:
    return {
        f"body{index}_{part}": mi.load_dict(spectrum(radiance, where=f"body {body.name}"))
        for index, body in numbered(scene.bodies)
        for part, radiance in getattr(body, "glow", {}).items()
    }


def openings(scene: Scene, *, rig_poses: np.ndarray) -> np.ndarray:
    """Return where light leaves lamps and enters the camera, in the world for rig poses (n, 4, 4): (n, points, 3) [m].

    The lamps' front faces with LEDs and domes, the camera's port or pinhole: middles and edges.
    """
    camera = scene.rig.camera
    pixels = np.array([[x, y] for x in (0, 0.5, 1) for y in (0, 0.5, 1)]) * (camera.width_px, camera.height_px)
    origins = scene.lens.rays(pixels)[0]
    points = [origins[np.all(np.isfinite(origins), axis=-1)]]
    for lamp in scene.rig.lamps:
        radius, up = lamp.front_radius_m, lamp.dome_radius_m
        edge = [[radius, 0, 0], [-radius, 0, 0], [0, radius, 0], [0, -radius, 0]] if radius > 0 else []
        points.append(pose.apply(lamp.rig_from_front, np.array([[0, 0, up], *edge], float)))
    return np.stack([pose.apply(at, np.concatenate(points)) for at in rig_poses])


def _snow(mi, scene: Scene) -> dict:
    """Return the particles by shape id, without those in the way of the rig's openings during the exposure."""
    shapes = {}
    for index, snow in enumerate(body for body in scene.bodies if isinstance(body, MarineSnow)):
        times_s = scene.shutter.step_times_s(_TIMES_OF_SNOW) if scene.moves else np.zeros(1)
        at = openings(scene, rig_poses=rig_poses(scene, times_s))
        in_cloud = [
            pose.apply(cloud_from_world, points)
            for cloud_from_world, points in zip(pose.inverse(snow.poses_at(times_s)), at, strict=True)
        ]
        shape = snow_shape(mi, snow, openings_m=np.stack(in_cloud))
        if shape is not None:
            shapes[f"snow{index}"] = shape
    return shapes


def _sub_frames(scene: Scene, loaded, *, count: int) -> SubFrames | None:
    if count == 1:
        return None
    prefixes = {f"body{index}_": body for index, body in numbered(scene.bodies)}
    clouds = [body for body in scene.bodies if isinstance(body, MarineSnow)]
    prefixes |= {f"snow{index}": cloud for index, cloud in enumerate(clouds)}
    times_s, moves = scene.shutter.step_times_s(count), {}
    for prefix, body in prefixes.items():
        if body.moves:
            then = body.poses_at(times_s) @ pose.inverse(body.world_from_body)
            names = (shape.id() for shape in loaded.shapes())
            moves |= {name: then for name in names if name == prefix or name.startswith(prefix) and prefix[-1] == "_"}
    return SubFrames(loaded, moves) if moves else None


def body_number(shape_id: str) -> int:
    """Return the instance number of the body that a Mitsuba shape belongs to."""
    return int(shape_id.removeprefix("body").partition("_")[0])


def load_medium(mi, water: Water | None, *, even_if_empty: bool = False):
    """Return the Mitsuba medium of a body of water; None where it neither absorbs nor scatters."""
    if water is None or not (even_if_empty or np.any(water.attenuation > 0)):
        return None
    # a ray whose wavelengths include one without any attenuation would lose its scattered light (0 x inf)
    attenuation = np.maximum(water.attenuation, LEAST_ATTENUATION_PER_M)
    return mi.load_dict(
        {
            "type": "homogeneous",
            "sigma_t": spectrum(attenuation),
            "albedo": spectrum(water.scattering / attenuation),
            "phase": phase_description(mi, water.phase),
        }
    )


def integrator_description(name: str) -> dict:
    """Return the Mitsuba description of an integrator: unlimited depth, ended by Russian roulette, no bias."""
    return {"type": name, "max_depth": -1, "rr_depth": 5}


def _lamp(mi, lamp, poses: np.ndarray, *, n_water: float) -> dict:
    description = {
        "type": "led",
        "poses": tensor(mi, (poses @ lamp.rig_from_lamp)[:, :3, :]),
        "profile": tensor(mi, lamp.profile),
        "intensity": spectrum(lamp.intensity_w_per_sr * lamp.relative_spectrum, where=f"lamp {lamp.name}"),
        "die_radius": lamp.die_radius_m,
    }
    if lamp.array is not None:
        description["leds"] = tensor(mi, lamp.lamp_from_led[:, :3, :])
    if isinstance(lamp.window, FlatLampWindow):
        description |= {
            "window": "flat",
            "front": lamp.window.front_m,
            "thickness": lamp.window.thickness_m,
            "radius": lamp.window.radius_m,
            "n_glass": lamp.window.n_glass,
            "n_water": n_water,
            "glass_absorption": lamp.window.glass_absorption_per_m,
            "through_window": lamp.window.calibration == "through_window",
        }
    elif lamp.window is not None:
        description |= {
            "window": "dome",
            "radius": lamp.window.outer_radius_m,
            "transmittance": lamp.window.transmittance(n_water=n_water),
            "cos_half_aperture": float(np.cos(np.radians(lamp.window.half_aperture_deg))),
        }
    return description
