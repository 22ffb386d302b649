"""Views made of arrays, without a scene: a camera at the origin that looks along x at a wall, lit by one lamp."""

import numpy as np

from uwsim.camera.lens import Lens, pixel_centres
from uwsim.formation.light import Lamp
from uwsim.formation.view import View, pixel_angle_rad
from uwsim.optics import beam_profile, phase
from uwsim.optics.sources import camera_response, illuminant
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water

RESPONSE = camera_response("Nikon 5100 (NPL)")
FLAT = np.ones(len(WAVELENGTHS_NM))
# camera axes (x right, y down, z forward) in the world (z up), looking along world x
WORLD_FROM_CAMERA = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
DEPTH_M = 2.0


def grey_water(*, absorption_per_m: float, scattering_per_m: float, g: float = 0.9) -> Water:
    """Return water that is the same at every wavelength."""
    return Water("grey", absorption_per_m * FLAT, scattering_per_m * FLAT, phase.constant([g], [1.0]))


def lamp(*, position_m=(0.0, -0.15, 0.0), profile=None, window=None, spectrum=None, **changes) -> Lamp:
    """Return a lamp of 1 W/sr at a place in camera axes that shines forwards."""
    pose = np.eye(4)
    pose[:3, :3] = WORLD_FROM_CAMERA
    pose[:3, 3] = WORLD_FROM_CAMERA @ np.array(position_m) + [0, 0, -DEPTH_M]
    given = {
        "name": "led", "spectrum": illuminant("LED-B3") if spectrum is None else spectrum, "world_from_lamp": pose,
        "profile": profile or beam_profile.lambertian(half_angle_deg=40.0), "lamp_from_led": np.eye(4),
        "window": window,
    }  # fmt: skip
    return Lamp(**given | changes)


def isotropic(angle_rad, azimuth_rad):
    return np.ones_like(angle_rad)


def view(
    *, width_px=16, height_px=12, fov_deg=50.0, wall_m=1.0, albedo=0.5, water=None, lamps=None, **changes
) -> View:  # fmt: skip
    """Return a view of a wall at `wall_m` along the axis (inf: nothing), at DEPTH_M below the surface."""
    focal = width_px / 2 / np.tan(np.radians(fov_deg / 2))
    lens = Lens(K=np.array([[focal, 0, width_px / 2], [0, focal, height_px / 2], [0, 0, 1]]))
    origins, rays = lens.rays(pixel_centres(width_px=width_px, height_px=height_px))
    normals = np.zeros_like(rays)
    normals[..., 2] = -1 if np.isfinite(wall_m) else 0
    given = {
        "origins_m": origins @ WORLD_FROM_CAMERA.T + [0, 0, -DEPTH_M],
        "directions": rays @ WORLD_FROM_CAMERA.T,
        "range_m": (wall_m / rays[..., 2]).astype(np.float32),
        "normals": (normals @ WORLD_FROM_CAMERA.T).astype(np.float32),
        "albedo": np.full((height_px, width_px, 1), albedo, np.float32),
        "albedo_spectra": np.ones((1, len(WAVELENGTHS_NM))),
        "water": water or grey_water(absorption_per_m=0.2, scattering_per_m=0.4),
        "lamps": (lamp(),) if lamps is None else lamps,
        "response": RESPONSE,
        "factor": np.ones((height_px, width_px)),
        "pixel_angle_rad": pixel_angle_rad(lens, width_px=width_px, height_px=height_px),
    }
    return View(**given | changes)
