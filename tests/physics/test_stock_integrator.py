"""The whole image against Mitsuba's own `volpathmis`: the same emitters and rays, another way to sample."""

import numpy as np
import pytest

from tests.physics import scenes, slabs
from tests.references.monte_carlo import assert_two_samples_agree
from uwsim.render import film, transport
from uwsim.render.build import build

WATER = slabs.tabulated(absorption_per_m=0.3, scattering_per_m=0.7, phase={"type": "hg", "g": 0.75})
LAMP = {"half_angle_deg": 35.0, "radiant_flux_w": 5.0, "spectrum": "E"}
AHEAD = {"look_at_m": [0.0, 0.0, 0.7]}
WALL = {
    "name": "wall", "kind": "rectangle", "width_m": 3.0, "height_m": 2.0, "reflectance": 0.4,
    "position_m": [0.0, 0.9, -0.6], "towards_m": [0.0, 0.0, -0.6],
}  # fmt: skip
CHECKER = {
    "name": "chart", "kind": "colorchecker", "width_m": 0.42, "position_m": [0.0, 0.7, -0.6],
    "towards_m": [0.0, 0.0, -0.6],
}  # fmt: skip
BOARD = {
    "name": "board", "kind": "marker_board", "columns": 3, "rows": 2, "marker_size_m": 0.12, "gap_m": 0.04,
    "position_m": [0.0, 0.7, -0.6], "towards_m": [0.0, 0.0, -0.6], "rotation_deg": [15.0, -20.0, 5.0],
}  # fmt: skip
FLAT = {"window": {"air_gap_m": 0.01, "thickness_m": 0.005, "radius_m": 0.03}}
DOME = {"window": {"kind": "dome", "inner_radius_m": 0.03, "thickness_m": 0.004}}

# camera, lamps, bodies; lamps well apart from the view, where the stock integrator has its worst tail
CASES = {
    "bare-lamp": ({}, [LAMP | AHEAD | {"position_m": [0.6, 0.0, 0.0]}], [WALL]),
    "window-and-port": (
        {"port": {"kind": "flat", "gap_m": 0.02, "thickness_m": 0.01}},
        [LAMP | AHEAD | FLAT | {"position_m": [-0.6, -0.1, 0.0]}],
        [CHECKER, WALL],
    ),
    "board-two-lamps": (
        {"port": {"kind": "dome", "inner_radius_m": 0.05, "thickness_m": 0.005}},
        [
            LAMP | AHEAD | {"name": "right", "position_m": [0.6, 0.0, 0.0]},
            LAMP | AHEAD | DOME | {"name": "left", "position_m": [-0.5, -0.3, 0.1]},
        ],
        [BOARD, WALL],
    ),
}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_of(name: str):
    camera, lamps, bodies = CASES[name]
    return scenes.Scene.model_validate(
        {
            "name": name,
            "description": "a tank, near the origin",
            "water": WATER,
            "rig": {
                "position_m": [0.0, 0.0, -0.6],
                "look_at_m": [0.0, 1.0, -0.6],
                "camera": {"width_px": 8, "height_px": 6, "horizontal_fov_deg": 40.0, "response": scenes.RESPONSE}
                | camera,
                "lamps": lamps,
            },
            "bodies": bodies,
            "exposure": {"time_s": 0.01},
        }
    )


def quarters(scene, *, samples: int, count: int, reference: bool) -> np.ndarray:
    """Return the means over the quarters of the image, (count, 4 x 3 bands); seeds differ between the integrators."""
    view = film.view_of(scene)
    built = build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None])
    found = []
    for seed in range(count):
        options = {"samples_per_pixel": samples, "batches": 2, "seed": seed + 100 * reference}
        if reference:
            image = transport.reference_radiance(built, view, **options)[0]
        else:
            image = transport.layers(built, view, **options)["radiance"]
        found.append(image.reshape(2, 3, 2, 4, 3).mean(axis=(1, 3)).ravel())
    return np.array(found, float)


@pytest.mark.parametrize(
    ("name", "samples", "reference_samples", "largest"),
    [
        ("board-two-lamps", 256, 4096, 0.015),
        *(pytest.param(name, 512, 16384, 0.015, marks=pytest.mark.slow) for name in CASES),
    ],
)
def test_total_is_that_of_the_stock_integrator(name, samples, reference_samples, largest):
    """Setup: water of 1 /m, albedo 0.7, g = 0.75; bare lamp before a wall; lamp behind a flat window, camera behind a
    flat port and a ColorChecker; two lamps, one in a dome, dome port and a tilted marker board. Expected: the quarters
    of the image in every band as by `volpathmis`. Tolerance: Monte Carlo of both (1.5 %), model 3e-3 (float32 offsets
    of new rays). Negative control: 8 % brighter."""
    scene = scene_of(name)
    found = quarters(scene, samples=samples, count=12, reference=False)
    reference = quarters(scene, samples=reference_samples, count=16, reference=True)
    assert_two_samples_agree(found, reference, largest=largest)
    with pytest.raises(AssertionError, match="biased"):
        assert_two_samples_agree(1.08 * found, reference, largest=largest)
