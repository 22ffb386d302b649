"""What a scene says about its frames without rendering: sensor constants, band coefficients, marker corners."""

import numpy as np

from uwsim.camera import auto_exposure, mosaic, pose, sensor, vignetting
from uwsim.camera.shutter import see
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import WAVELENGTHS_NM, band_mean
from uwsim.scene.bodies import CharucoBoard, MarkerBoard, MarkerLayout
from uwsim.scene.models import Scene
from uwsim.scene.sensor import AutoTime

# A corner counts as hidden when something is seen this share of its range in front of it.
_HIDDEN_SHARE = 0.02
_LEAST_SIGNAL = 0.02


def sensor_constants(scene: Scene) -> dict:
    """Return the sensor keywords of `camera.sensor` (its `Constants`) for the time and gain that the scene gives.

    With auto-exposure these are where it starts; `auto_exposed` returns the scene with what it finds.
    Raises ValueError if the scene's sensor cannot work so: a dark band, a well full of dark current, vignetting below
    0, an exposure time to be chosen although something moves.
    """
    chosen = scene.sensor
    if isinstance(scene.exposure.auto, AutoTime):
        _check_at_rest(scene)
    response = camera_response(scene.rig.camera.response)
    electrons = sensor.electrons_per_radiance(
        exposure_time_s=scene.exposure.time_s, f_number=scene.exposure.f_number,
        pixel_pitch_m=chosen.pixel_pitch_m, peak_quantum_efficiency=chosen.peak_quantum_efficiency,
        response=response, wavelengths_nm=WAVELENGTHS_NM,
    )  # fmt: skip
    light = scene.rig.lamps[0] if scene.rig.lamps else scene.daylight
    grey = band_mean(light.relative_spectrum, response) * electrons
    constants = {
        "electrons_per_radiance": electrons,
        "full_well_e": chosen.full_well_e,
        "white_balance": white_balance(scene, grey),
        "read_noise_e": chosen.read_noise_e,
        "dark_e": chosen.dark_current_e_per_s * scene.exposure.time_s,
        "prnu": chosen.prnu,
        "dsnu_e": chosen.dsnu_e,
        "pattern_seed": chosen.pattern_seed,
        "gain": chosen.relative_gain,
        "adc_bits": chosen.adc_bits,
        "black_level_dn": chosen.black_level_dn,
        "mosaic": chosen.mosaic,
        "demosaic": chosen.demosaic,
        "relative_illumination": _relative_illumination(scene),
    }
    sensor.Constants(**constants)  # refuses what no sensor can do
    if chosen.mosaic is not None:
        mosaic.check_size((scene.rig.camera.height_px, scene.rig.camera.width_px))
    return constants


def _relative_illumination(scene: Scene) -> np.ndarray | None:
    fall, camera = scene.sensor.vignetting, scene.rig.camera
    if fall is None:
        return None
    return vignetting.relative_illumination(
        camera.K, width_px=camera.width_px, height_px=camera.height_px, cos4=fall.cos4, polynomial=fall.polynomial
    )


def _check_at_rest(scene: Scene) -> None:
    motion = scene.rig.motion
    moves = motion is not None and any((*motion.velocity_m_per_s, *motion.rotation_deg_per_s))
    moves |= scene.rig.trajectory is not None
    if moves or scene.moving_bodies:
        raise ValueError(
            f"exposure.auto.adjust = 'time' with {'a rig' if moves else 'a body'} in motion, allowed: 'gain' "
            "(the motion blur depends on the time)"
        )


def auto_exposed(scene: Scene, radiance: np.ndarray) -> tuple[Scene, float | None]:
    """Return the scene with the time or gain that its auto-exposure chooses, and the brightness that this reaches.

    `radiance` (H, W, 3): the image without sensor noise. Where a limit of the scene is met first, the brightness
    differs from the target. Without auto-exposure: the scene as it is, and None.
    """
    auto = scene.exposure.auto
    if auto is None:
        return scene, None
    constants = sensor_constants(scene)
    linear = sensor.linear_from_radiance(radiance, **constants)
    factor = auto_exposure.brightness_factor(linear, target=auto.target, percentile=auto.percentile)
    at = {"dark_e": constants["dark_e"], "saturation_e": sensor.Constants(**constants).saturation_e}
    if isinstance(auto, AutoTime):
        time_s = auto_exposure.time_for(factor, time_s=scene.exposure.time_s, **at)
        exposure = scene.exposure.model_copy(update={"time_s": min(max(time_s, auto.least_time_s), auto.most_time_s)})
        exposed = scene.model_copy(update={"exposure": exposure})
    else:
        gain = auto_exposure.gain_for(factor, full_well_e=scene.sensor.full_well_e, **at)
        found = {"gain": min(max(gain, 1.0), auto.most_gain), "gain_dn_per_e": None}
        exposed = scene.model_copy(update={"sensor": scene.sensor.model_copy(update=found)})
    linear = sensor.linear_from_radiance(radiance, **sensor_constants(exposed))
    return exposed, auto_exposure.metered(linear, percentile=auto.percentile)


def white_balance(scene: Scene, grey: np.ndarray) -> np.ndarray:
    """Return the gain of each band, at least 1: as given, else such that a grey body is neutral.

    Under the first lamp, or in daylight if there is none. `grey` (3,): the electrons that such a body makes.
    Raises ValueError if a band gets next to none.
    """
    if scene.sensor.white_balance is not None:
        return np.array(scene.sensor.white_balance)
    if grey.min() < _LEAST_SIGNAL * grey.max():
        shares = np.round(grey / grey.max(), 4).tolist()
        light = f"lamp {scene.rig.lamps[0].name}" if scene.rig.lamps else "daylight"
        raise ValueError(
            f"{light}: a grey body gives the bands signals {shares}, "
            f"allowed: at least {_LEAST_SIGNAL} of the strongest; give sensor.white_balance = [r, g, b] for such light"
        )
    return grey.max() / grey


def water_bands(scene: Scene) -> dict:
    """Return a, b, c per camera band, weighted by camera response x lamp light, without lamps x daylight. [1/m]"""
    lamps = scene.rig.lamps
    light = sum(lamp.intensity_w_per_sr * lamp.relative_spectrum for lamp in lamps)
    light = light if lamps else scene.daylight.relative_spectrum
    weights = camera_response(scene.rig.camera.response) * light[:, None]
    water = scene.water.optical()
    return {
        "weighting": f"camera response x {'lamp' if lamps else 'daylight'} spectrum",
        "absorption_per_m": band_mean(water.absorption, weights).tolist(),
        "scattering_per_m": band_mean(water.scattering, weights).tolist(),
        "attenuation_per_m": band_mean(water.attenuation, weights).tolist(),
    }


def marker_corners(scene: Scene, *, range_m: np.ndarray) -> list[dict]:
    """Return the `markers` entries of frame.json: corners in body, world and image, and which are visible.

    In the image as seen in the middle of the exposure, with a rolling shutter in that of the row that sees the corner.
    `range_m` (H, W) is the range buffer then: a corner behind something nearer is hidden.
    """
    found = []
    for body in scene.bodies:
        if not isinstance(body, (MarkerBoard, CharucoBoard)):
            continue
        facing = _faces_camera(body, scene.rig.world_from_rig)
        for marker_id, corners in zip(body.ids, body.corners_m, strict=True):
            world = pose.apply(body.world_from_body, corners)
            pixels, local = see(world, lens=scene.lens, poses_at=scene.rig.poses_at, shutter=scene.shutter)
            distances = np.linalg.norm(local - scene.lens.rays(pixels)[0], axis=-1)
            seen = [facing and _visible(p, d, range_m) for p, d in zip(pixels, distances, strict=True)]
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


def marker_points(scene: Scene, *, range_m: np.ndarray) -> list[dict]:
    """Return the `points` entries of frame.json: centres of spheres and corners of chessboards.

    Image and `range_m` as in `marker_corners`. A sphere counts as visible where its near side is.
    """
    found = []
    for body in scene.bodies:
        if isinstance(body, MarkerLayout):
            kind, radius_m, points, facing = "sphere", body.sphere_radius_m, body.points_m, True
        elif isinstance(body, CharucoBoard):
            kind, radius_m, points = "corner", None, body.chessboard_corners_m
            facing = _faces_camera(body, scene.rig.world_from_rig)
        else:
            continue
        world = pose.apply(body.world_from_body, points)
        pixels, local = see(world, lens=scene.lens, poses_at=scene.rig.poses_at, shutter=scene.shutter)
        distances = np.linalg.norm(local - scene.lens.rays(pixels)[0], axis=-1) - (radius_m or 0.0)
        for number, (at, there, pixel, distance) in enumerate(zip(points, world, pixels, distances, strict=True)):
            found.append(
                {
                    "body": body.name,
                    "id": number,
                    "kind": kind,
                    "radius_m": radius_m,
                    "point_body_m": at.tolist(),
                    "point_world_m": there.tolist(),
                    "point_px": pixel.tolist() if np.all(np.isfinite(pixel)) else None,
                    "visible": facing and _visible(pixel, distance, range_m),
                }
            )
    return found


def _faces_camera(body: MarkerBoard | CharucoBoard, world_from_camera: np.ndarray) -> bool:
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
