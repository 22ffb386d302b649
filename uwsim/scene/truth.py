"""What a scene says about its frames without rendering: sensor constants, band coefficients, marker corners."""

import numpy as np

from uwsim.camera import pinhole, pose, sensor
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean
from uwsim.scene.bodies import MarkerBoard
from uwsim.scene.models import Scene

# A corner counts as hidden when something is seen this share of its range in front of it.
_HIDDEN_SHARE = 0.02
_LEAST_SIGNAL = 0.02


def sensor_constants(scene: Scene) -> dict:
    """Return the keywords of `camera.sensor.expose`: electrons per radiance, full well, noise, white balance."""
    response = camera_response(scene.rig.camera.response)
    electrons = sensor.electrons_per_radiance(
        exposure_time_s=scene.exposure.time_s, f_number=scene.exposure.f_number,
        pixel_pitch_m=scene.sensor.pixel_pitch_m, peak_quantum_efficiency=scene.sensor.peak_quantum_efficiency,
        response=response, wavelengths_nm=WAVELENGTHS_NM,
    )  # fmt: skip
    grey = band_mean(scene.rig.lamps[0].relative_spectrum, response) * electrons
    return {
        "electrons_per_radiance": electrons,
        "full_well_e": scene.sensor.full_well_e,
        "read_noise_e": scene.sensor.read_noise_e,
        "white_balance": white_balance(scene, grey),
    }


def white_balance(scene: Scene, grey: np.ndarray) -> np.ndarray:
    """Return the gain of each band, at least 1: as given, else such that a grey body under the first lamp is neutral.

    `grey` (3,): the electrons that such a body makes. Raises ValueError if a band gets next to none.
    """
    if scene.sensor.white_balance is not None:
        return np.array(scene.sensor.white_balance)
    if grey.min() < _LEAST_SIGNAL * grey.max():
        shares = np.round(grey / grey.max(), 4).tolist()
        raise ValueError(
            f"lamp {scene.rig.lamps[0].name}: a grey body gives the bands signals {shares}, "
            f"allowed: at least {_LEAST_SIGNAL} of the strongest; give sensor.white_balance = [r, g, b] for such a lamp"
        )
    return grey.max() / grey


def water_bands(scene: Scene) -> dict:
    """Return a, b, c per camera band, weighted by camera response x lamp light. [1/m]"""
    light = sum(lamp.intensity_w_per_sr * lamp.relative_spectrum for lamp in scene.rig.lamps)
    weights = camera_response(scene.rig.camera.response) * light[:, None]
    water = scene.water.optical()
    return {
        "weighting": "camera response x lamp spectrum",
        "absorption_per_m": band_mean(water.absorption, weights).tolist(),
        "scattering_per_m": band_mean(water.scattering, weights).tolist(),
        "attenuation_per_m": band_mean(water.attenuation, weights).tolist(),
    }


def marker_corners(scene: Scene, *, world_from_camera: np.ndarray, range_m: np.ndarray) -> list[dict]:
    """Return the `markers` entries of frame.json: corners in body, world and image, and which are visible.

    `range_m` (H, W) is the range buffer at mid-exposure: a corner behind something nearer is hidden.
    """
    camera, found = scene.rig.camera, []
    for body in scene.bodies:
        if not isinstance(body, MarkerBoard):
            continue
        facing = _faces_camera(body, world_from_camera)
        for marker_id, corners in zip(body.ids, body.corners_m, strict=True):
            world = pose.apply(body.world_from_body, corners)
            local = pose.apply(pose.inverse(world_from_camera), world)
            pixels = pinhole.project(local, camera.K)
            seen = [facing and _visible(p, np.linalg.norm(c), range_m) for p, c in zip(pixels, local, strict=True)]
            found.append(
                {
                    "body": body.name,
                    "dictionary": body.dictionary,
                    "id": marker_id,
                    "corners_body_m": corners.tolist(),
                    "corners_world_m": world.tolist(),
                    "corners_px": pixels.tolist() if np.all(np.isfinite(pixels)) else None,
                    "visible": seen,
                }
            )
    return found


def _faces_camera(body: MarkerBoard, world_from_camera: np.ndarray) -> bool:
    to_camera = world_from_camera[:3, 3] - body.world_from_body[:3, 3]
    return bool(body.world_from_body[:3, 2] @ to_camera > 0)


def _visible(pixel: np.ndarray, distance_m: float, range_m: np.ndarray) -> bool:
    """Whether a point at `pixel` is inside the image and nothing nearer is seen around it."""
    height, width = range_m.shape
    if not (np.all(np.isfinite(pixel)) and 0 <= pixel[0] < width and 0 <= pixel[1] < height):
        return False
    column, row = int(pixel[0]), int(pixel[1])
    around = range_m[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    return bool(around.max() >= distance_m * (1 - _HIDDEN_SHARE))
