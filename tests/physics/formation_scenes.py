"""Small scenes as formation models see them, and the renderer's answer, region by region."""

import numpy as np
import pytest

from uwsim.camera.lens import pixel_centres, port_record
from uwsim.dataset import make
from uwsim.formation import records
from uwsim.formation.view import View, albedo_of_bands, pixel_angle_rad
from uwsim.render import film, geometry, integrator, transport
from uwsim.render.accumulate import accumulate
from uwsim.render.build import build
from uwsim.scene.models import Scene

REGIONS = (2, 3)
FINER = 4  # model pixels across one of the renderer's


def scene(*, lamps, camera=None, bodies=None, water=None, size_px=(12, 8)) -> Scene:
    """Return a scene in a tank: a grey wall or what is given, seen along y from a rig 2 m below the surface."""
    values = {
        "name": "formation",
        "description": "a wall in a tank",
        "water": water or {"name": "tank_low"},
        "rig": {
            "position_m": [0, 0, -2],
            "look_at_m": [0, 1, -2],
            "camera": {
                "width_px": size_px[0], "height_px": size_px[1], "horizontal_fov_deg": 50.0,
                "response": "Nikon 5100 (NPL)",
            }
            | (camera or {}),
            "lamps": lamps,
        },
        "bodies": bodies or [wall()],
        "exposure": {"time_s": 0.01},
    }  # fmt: skip
    return Scene.model_validate(values)


def wall(*, at_m=(0.0, 1.0, -2.0), towards_m=(0.0, 0.0, -2.0), size_m=8.0, reflectance=0.5, name="wall") -> dict:
    return {
        "name": name, "kind": "rectangle", "width_m": size_m, "height_m": size_m, "reflectance": reflectance,
        "position_m": list(at_m), "towards_m": list(towards_m),
    }  # fmt: skip


def lamp(**changes) -> dict:
    given = {
        "name": "led", "position_m": [0.0, -0.15, 0.0], "look_at_m": [0.0, 0.0, 1.0],
        "radiant_intensity_w_per_sr": 2.0, "half_angle_deg": 40.0, "spectrum": "LED-B3",
    }  # fmt: skip
    return given | changes


def view_of(scene: Scene, *, finer: int = FINER) -> View:
    """Return the view of a scene, its rays `finer` times closer; lamps and water by way of their records."""
    camera = scene.rig.camera
    size = {"width_px": camera.width_px * finer, "height_px": camera.height_px * finer}
    close = scene.model_copy(
        update={"rig": scene.rig.model_copy(update={"camera": camera.model_copy(update=size)})}
    )  # fmt: skip
    seen = film.view_of(close)
    buffers = geometry.geometry(close, seen)
    origins, directions = geometry.pixel_rays(close, seen)
    albedo, spectra = albedo_of_bands(buffers["albedo"], response=seen.response)
    entries = [
        make._lamp(one, scene.rig.world_from_rig, n_water=scene.water.refractive_index) for one in scene.rig.lamps
    ]
    factor = close.lens.radiance_factor(pixel_centres(**size))
    assert (port_record(close.lens.port) is None) == (camera.port is None)
    return View(
        origins_m=origins, directions=directions, range_m=buffers["range"], normals=buffers["normal"], albedo=albedo,
        albedo_spectra=spectra, water=records.water(make._water(scene)),
        lamps=tuple(led for entry in entries for led in records.leds(entry)), response=seen.response,
        factor=np.nan_to_num(factor), pixel_angle_rad=pixel_angle_rad(close.lens, **size),
    )  # fmt: skip


def region_means(picture: np.ndarray) -> np.ndarray:
    """Return the means of a picture (H, W, 3) over REGIONS, (regions, 3)."""
    rows, columns = REGIONS
    h, w, bands = picture.shape
    return picture.reshape(rows, h // rows, columns, w // columns, bands).mean(axis=(1, 3)).reshape(-1, bands)


def rendered(scene: Scene, *, samples: int, names: tuple[str, ...], count: int = 8) -> dict[str, np.ndarray]:
    """Return layers of the renderer by name, means over the regions, (count, regions, 3), each with its own seed.

    With paths of one segment: what was scattered or reflected once, all that `direct_unscattered` and
    `backscatter_single` hold.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(integrator, "MOST_SEGMENTS", 1)
        return _rendered(scene, samples=samples, names=names, count=count)


def _rendered(scene: Scene, *, samples: int, names: tuple[str, ...], count: int) -> dict[str, np.ndarray]:
    built = build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None])
    view, walk = film.view_of(scene), transport.estimate(built, orders=True)
    pictures = [
        transport.pictures(accumulate(built, view, walk, samples_per_pixel=samples, batches=2, seed=seed))
        for seed in range(count)
    ]
    return {name: np.stack([region_means(picture[name]) for picture in pictures]) for name in names}
