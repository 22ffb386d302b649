"""Small scenes with a closed form, as Mitsuba objects built by the project's own code."""

import numpy as np

from uwsim.camera import pose
from uwsim.optics import phase
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water
from uwsim.render import film, transport
from uwsim.render.build import build
from uwsim.scene.models import Scene

RESPONSE = "Nikon 5100 (NPL)"


def water(*, absorption_per_m: float, scattering_per_m: float = 0.0, g: float = 0.9) -> Water:
    """Grey water with the same coefficients at every wavelength."""
    flat = np.ones(len(WAVELENGTHS_NM))
    return Water("grey", absorption_per_m * flat, scattering_per_m * flat, phase.constant([g], [1.0]))


def spectral_water(*, low_per_m: float, high_per_m: float) -> Water:
    """Absorbing water whose coefficient rises linearly over the wavelengths."""
    absorption = np.linspace(low_per_m, high_per_m, len(WAVELENGTHS_NM))
    return Water("ramp", absorption, np.zeros_like(absorption), phase.constant([0.9], [1.0]))


def wall(*, distance_m: float, lamp_m=(0.05, 0.0, 0.0), half_angle_deg: float = 40.0, **changes) -> Scene:
    """A grey wall (reflectance 0.5) square to a narrow camera, lit by one lamp of 1 W/sr on its axis."""
    values = {
        "name": "wall",
        "description": "grey wall",
        "water": {"name": "tank_clear"},
        "rig": {
            "position_m": [0, 0, -100],
            "look_at_m": [0, 1, -100],
            "camera": {"width_px": 4, "height_px": 4, "horizontal_fov_deg": 0.2, "response": RESPONSE},
            "lamps": [
                {
                    "position_m": list(lamp_m),
                    "look_at_m": [lamp_m[0], lamp_m[1], lamp_m[2] + 1],
                    "radiant_intensity_w_per_sr": 1.0,
                    "half_angle_deg": half_angle_deg,
                    "spectrum": "E",
                }
            ],
        },
        "bodies": [
            {
                "name": "wall",
                "kind": "rectangle",
                "width_m": 50,
                "height_m": 50,
                "reflectance": 0.5,
                "position_m": [0, distance_m, -100],
                "towards_m": [0, 0, -100],
            }
        ],
        "exposure": {"time_s": 0.01},
    } | changes
    return Scene.model_validate(values)


def replicates(
    scene: Scene, *, water, samples: int, count: int = 16, layer: str = "radiance", reference: bool = False
) -> np.ndarray:
    """Return the mean over the image of a layer of band radiance, (count, 3), each with its own seed.

    `reference`: by Mitsuba's own integrator, which gives radiance only.
    """
    view = film.view_of(scene)
    built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])

    def image(seed):
        settings = {"samples_per_pixel": samples, "batches": 2, "seed": seed}
        if reference:
            return transport.reference_radiance(built, view, **settings)[0]
        return transport.layers(built, view, **settings)[layer]

    return np.stack([image(seed).mean(axis=(0, 1)) for seed in range(count)])


def wall_radiance(*, distance_m: float, lamp_m=(0.05, 0.0, 0.0), half_angle_deg: float = 40.0) -> tuple[float, float]:
    """Return the closed form at the point on the camera's axis, in vacuum, and the light path lamp-wall-camera.

    L = rho / pi x I_0 cos^m(angle) cos(angle) / d^2, spectral intensity 1 / 300 nm. [W m^-2 sr^-1 nm^-1, m]
    """
    offset = np.array([0, 0, distance_m]) - lamp_m
    lamp_distance_m = float(np.linalg.norm(offset))
    cosine = offset[2] / lamp_distance_m
    order = -np.log(2) / np.log(np.cos(np.radians(half_angle_deg)))
    radiance = 0.5 / np.pi * cosine ** (order + 1) / lamp_distance_m**2 / 300.0
    return radiance, lamp_distance_m + distance_m


def rig_at(y_m: float) -> np.ndarray:
    return pose.looking_at((0, y_m, -100), (0, y_m + 1, -100))
