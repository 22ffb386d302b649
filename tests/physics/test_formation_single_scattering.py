"""Direct light and single backscatter by formula equal the renderer's `direct_unscattered`, `backscatter_single`."""

import dataclasses

import numpy as np
import pytest

from tests.physics import formation_scenes as scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.formation import airlight, direct
from uwsim.optics.water import Water

FLAT_WINDOW = {"kind": "flat", "air_gap_m": 0.01, "thickness_m": 0.006, "radius_m": 0.03}
PORT = {"kind": "flat", "gap_m": 0.03, "thickness_m": 0.01}
FLOOR = scenes.wall(at_m=(0.0, 0.0, -2.25), towards_m=(0.0, 0.0, 0.0), reflectance=0.2, name="floor")
SLANTED = scenes.wall(at_m=(0.1, 1.0, -2.0), towards_m=(-0.5, 0.2, -1.7), name="slanted")
CASES = {
    "bare lamp, tank": {"lamps": [scenes.lamp()]},
    "turbid": {"lamps": [scenes.lamp()], "water": {"name": "tank_high"}},
    "two lamps, slanted wall, floor": {
        "lamps": [
            scenes.lamp(),
            scenes.lamp(name="cold", position_m=[0.3, 0.1, -0.05], look_at_m=[0.0, 0.0, 1.0], spectrum="LED-B5"),
        ],
        "bodies": [FLOOR, SLANTED],
    },
    "window and port": {
        "lamps": [scenes.lamp(window=FLAT_WINDOW, look_at_m=[0.0, 0.1, 1.0])],
        "camera": {"port": PORT, "horizontal_fov_deg": 66.0},
    },
    "ring of leds behind glass": {
        "lamps": [
            scenes.lamp(window=FLAT_WINDOW | {"radius_m": 0.05, "calibration": "through_window"},
                        array={"kind": "ring", "count": 3, "radius_m": 0.012, "outward_tilt_deg": 10.0})
        ],
    },
    "dome, tilted port": {
        "lamps": [
            scenes.lamp(window={"kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.004,
                                "half_aperture_deg": 70.0})
        ],
        "camera": {"port": PORT | {"tilt_deg": 15.0}, "horizontal_fov_deg": 60.0},
    },
}  # fmt: skip
NAMES = ("direct_unscattered", "backscatter_single")


@pytest.fixture(scope="module", params=CASES)
def case(request, llvm_spectral):
    scene = scenes.scene(**CASES[request.param])
    return scenes.view_of(scene), scenes.rendered(scene, samples=1024, names=NAMES)


def in_camera(view, radiance):
    return scenes.region_means(radiance * view.factor[..., None])


def test_direct_light(case):
    """Setup: tank scenes, 4 x 4 model pixels per rendered pixel, means over 2 x 3 regions in three bands. Expected: the
    renderer's unscattered direct light. Tolerance: Monte Carlo (0.2 %), model 2e-3 (pixel centres for areas at
    the edges of bodies, float32). Negative controls: c 2 % higher, and a surface that receives without the cosine."""
    view, found = case
    rule = {"max_relative_standard_error": 0.002, "model_tolerance": 2e-3}
    assert_mean_matches(found["direct_unscattered"], in_camera(view, direct.direct(view)), **rule)
    water = view.water
    denser = Water("denser", 1.02 * water.absorption, 1.02 * water.scattering, water.phase)
    for wrong in (
        direct.direct(dataclasses.replace(view, water=denser)), direct.direct(view, cosine=False)
    ):  # fmt: skip
        with pytest.raises(AssertionError, match="biased"):
            assert_mean_matches(found["direct_unscattered"], in_camera(view, wrong), **rule)


def test_backscatter(case):
    """Setup, tolerance as above. Expected: the renderer's backscatter of one particle. Negative controls: b alone 4 %
    higher, and lamps 2 cm further from the camera."""
    view, found = case
    rule = {"max_relative_standard_error": 0.01, "model_tolerance": 3e-3}
    model = sum(airlight.single(view, lamp) for lamp in view.lamps)
    assert_mean_matches(found["backscatter_single"], in_camera(view, model), **rule)
    moved = []
    for lamp in view.lamps:
        pose = lamp.world_from_lamp.copy()
        pose[:3, 3] += 0.02 * np.sign(pose[:3, 3] - view.origins_m.mean(axis=(0, 1))).round()
        moved.append(dataclasses.replace(lamp, world_from_lamp=pose))
    for wrong in (1.04 * model, sum(airlight.single(view, lamp) for lamp in moved)):
        with pytest.raises(AssertionError, match="biased"):
            assert_mean_matches(found["backscatter_single"], in_camera(view, wrong), **rule)
