"""A scene description as Mitsuba objects. The only place that calls `mi.load_dict` on a scene."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from uwsim.camera import pose
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water
from uwsim.render.shapes import body_shapes, spectrum, tensor
from uwsim.scene.models import Scene

LEAST_ATTENUATION_PER_M = 1e-6


@dataclass(frozen=True)
class Built:
    """A loaded scene: `scene` (Mitsuba), poses of the camera, and the `water` around it with its Mitsuba `medium`.

    `water` and `medium` are None where nothing absorbs or scatters.
    """

    scene: Any
    medium: Any
    world_from_camera: np.ndarray
    water: Water | None = None


def exposure_poses(scene: Scene, *, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) [s], mid-exposure = 0, and world_from_rig (n, 4, 4) at the middle of n equal steps."""
    times_s = ((np.arange(steps) + 0.5) / steps - 0.5) * scene.exposure.time_s
    return times_s, rig_poses(scene, times_s)


def rig_poses(scene: Scene, times_s: np.ndarray) -> np.ndarray:
    """Return world_from_rig (n, 4, 4) at times relative to mid-exposure."""
    motion = scene.rig.motion
    if motion is None:
        return np.tile(scene.rig.world_from_rig, (len(times_s), 1, 1))
    return pose.through_exposure(
        scene.rig.world_from_rig,
        velocity_m_per_s=motion.velocity_m_per_s,
        rotation_deg_per_s=motion.rotation_deg_per_s,
        times_s=times_s,
    )


def build(scene: Scene, *, water: Water | None, rig_poses: np.ndarray) -> Built:
    """Load a scene into the active Mitsuba variant.

    water: what fills the world, None for none (absorption = scattering = 0).
    rig_poses: world_from_rig (n, 4, 4) through the exposure.
    """
    import mitsuba as mi

    medium = load_medium(mi, water)
    description = {"type": "scene", "integrator": integrator_description("path" if medium is None else "volpathmis")}
    for index, lamp in enumerate(scene.rig.lamps):
        description[f"lamp{index}"] = _lamp(mi, lamp, rig_poses)
    return Built(
        scene=mi.load_dict(description | _bodies(mi, scene), optimize=False),
        medium=medium,
        world_from_camera=rig_poses,
        water=None if medium is None else water,
    )


def build_bodies(scene: Scene) -> Any:
    """Load the bodies alone, for casting rays; works in every variant."""
    import mitsuba as mi

    return mi.load_dict({"type": "scene"} | _bodies(mi, scene), optimize=False)


def _bodies(mi, scene: Scene) -> dict:
    return {
        f"body{index}_{part}": shape
        for index, body in enumerate(scene.bodies, start=1)
        for part, shape in body_shapes(mi, body).items()
    }


def body_number(shape_id: str) -> int:
    """Return the instance number of the body that a Mitsuba shape belongs to."""
    return int(shape_id.removeprefix("body").partition("_")[0])


def load_medium(mi, water: Water | None):
    """Return the Mitsuba medium of a body of water; None where it neither absorbs nor scatters."""
    if water is None or not np.any(water.attenuation > 0):
        return None
    low, high = float(WAVELENGTHS_NM[0]), float(WAVELENGTHS_NM[-1])
    # a ray whose wavelengths include one without any attenuation would lose its scattered light (0 x inf)
    attenuation = np.maximum(water.attenuation, LEAST_ATTENUATION_PER_M)
    return mi.load_dict(
        {
            "type": "homogeneous",
            "sigma_t": spectrum(attenuation),
            "albedo": spectrum(water.scattering / attenuation),
            "phase": {
                "type": "hg_mixture",
                "g": tensor(mi, water.phase.g),
                "weights": tensor(mi, water.phase.weights),
                "wavelength_min": low,
                "wavelength_max": high,
            },
        }
    )


def integrator_description(name: str) -> dict:
    """Return the Mitsuba description of an integrator: unlimited depth, ended by Russian roulette, no bias."""
    return {"type": name, "max_depth": -1, "rr_depth": 5}


def _lamp(mi, lamp, poses: np.ndarray) -> dict:
    return {
        "type": "led",
        "poses": tensor(mi, (poses @ lamp.rig_from_lamp)[:, :3, :]),
        "profile": tensor(mi, lamp.profile),
        "intensity": spectrum(lamp.intensity_w_per_sr * lamp.relative_spectrum, where=f"lamp {lamp.name}"),
    }
