"""Motion during the exposure: streaks of points on a path, with a global and a rolling shutter, and their labels."""

import dataclasses

import numpy as np
import pytest

from tests.physics import scenes
from uwsim.camera import pose
from uwsim.camera.shutter import Shutter, see
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render import film, geometry, motion, transport
from uwsim.render.build import Built, exposure_poses, integrator_description
from uwsim.scene.models import Scene

WIDTH_PX, HEIGHT_PX = 64, 40
PORT = {"kind": "flat", "gap_m": 0.02, "thickness_m": 0.01, "tilt_deg": 8.0}
SIZE_M = 0.03  # of the bright square
AT_M = np.array([0.0, 1.0, -0.93])
EXPOSURE_S = 0.02
# a bent path: the rig moves sideways and up, turns and rolls, faster towards the end
PATH = {
    "times_s": (-0.03, -0.004, 0.01, 0.03),
    "positions_m": ((-0.19, 0.0, -1.0), (-0.02, 0.01, -1.02), (0.07, 0.02, -0.98), (0.3, 0.03, -0.95)),
    "look_at_m": ((-0.17, 1, -1), (-0.03, 1, -1.02), (0.06, 1, -0.99), (0.2, 1, -0.97)),
}
ROLLING = pytest.mark.parametrize("readout_s", [0.0, 0.03], ids=["global", "rolling"])


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_on_path(readout_s: float, *, time_s: float = EXPOSURE_S, **rig) -> Scene:
    values = scenes.wall(distance_m=1.0).model_dump()
    camera = {"width_px": WIDTH_PX, "height_px": HEIGHT_PX, "horizontal_fov_deg": 30.0, "port": PORT}
    place = rig or {"trajectory": PATH}
    wall = {
        "name": "wall", "kind": "rectangle", "width_m": 5.0, "height_m": 5.0, "reflectance": 0.5,
        "position_m": (0.0, 1.2, -1.0), "towards_m": (0.3, 0.0, -1.1),
    }  # fmt: skip
    kept = {key: values[key] for key in ("name", "description", "water")} | {"bodies": (wall,)}
    rig = place | {"camera": camera | {"distortion": (-0.1, 0.02, 0.0, 0.001)}, "lamps": values["rig"]["lamps"]}
    return Scene.model_validate(kept | {"rig": rig, "exposure": {"time_s": time_s, "readout_s": readout_s}})


def square() -> np.ndarray:
    """Return world_from_square (4, 4) of the bright square, which looks towards the rig; sides 2 in its own frame."""
    turned = pose.looking_at(AT_M, (0.0, 0.0, -1.0))
    return turned @ np.diag([SIZE_M / 2, SIZE_M / 2, 1, 1])


def images(scene: Scene, view: film.View, poses: np.ndarray) -> np.ndarray:
    """Return replicates (R, H, W) of the image of the bright square alone in the dark."""
    import mitsuba as mi

    description = {
        "type": "scene",
        "integrator": integrator_description("path"),
        "square": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f(square()),
            "light": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}},
        },
    }
    built = Built(mi.load_dict(description, optimize=False), None, poses)
    flat = np.ones(len(WAVELENGTHS_NM))
    view = dataclasses.replace(view, response=np.tile(flat[:, None], (1, 3)), importance=flat)
    factor = scene.lens.radiance_factor(centres())  # the light that the port takes is no part of the streak
    found = [transport.reference_radiance(built, view, samples_per_pixel=256, batches=2, seed=s)[0] for s in range(8)]
    return np.stack([image[..., 0] / factor for image in found])


def centres() -> np.ndarray:
    rows, columns = np.mgrid[0:HEIGHT_PX, 0:WIDTH_PX] + 0.5
    return np.stack([columns, rows], axis=-1)


def moments(places_px: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return centroid and standard deviations along the axes (4,) [px] of weighted places (..., 2)."""
    weights = weights / weights.sum()
    mean = np.sum(places_px * weights[..., None], axis=tuple(range(weights.ndim)))
    square = np.sum((places_px - mean) ** 2 * weights[..., None], axis=tuple(range(weights.ndim)))
    return np.concatenate([mean, np.sqrt(square)])


def projected(scene: Scene, poses_at, shutter: Shutter) -> np.ndarray:
    """Return the moments of the square's projected path: a mean over times and places, weighted by their image's area.

    A place counts at the times at which the row that it falls on is exposed.
    """
    steps = (np.arange(20) + 0.5) / 10 - 1
    places = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    nearby = np.concatenate([places, places + [1e-4, 0], places + [0, 1e-4]])
    points = pose.apply(square(), np.concatenate([nearby, np.zeros((len(nearby), 1))], axis=-1))
    times_s = shutter.step_times_s(1000)
    local = pose.apply_each(pose.inverse(poses_at(times_s))[:, None], points[None])
    here, along, across = np.split(scene.lens.project(local)[0], 3, axis=1)
    along, across = along - here, across - here
    middles_s = shutter.middle_s(np.floor(here[..., 1]) + 0.5)
    is_exposed = np.abs(times_s[:, None] - middles_s) <= shutter.exposure_s / 2
    is_inside = np.all((here >= 0) & (here < (WIDTH_PX, HEIGHT_PX)), axis=-1)
    area = np.abs(along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0])
    # a uniform pixel's own spread belongs to what lies within it: places are rounded to centres of pixels
    return moments(np.floor(here) + 0.5, area * is_exposed * is_inside)


def agree(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return the distances (4,) [px] of replicates (R, 4); fail if their standard error is too large to tell."""
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
    assert error.max() < 0.0125, f"test has no power: standard error {error.max():.3g} px"
    return np.abs(found.mean(axis=0) - expected)


@ROLLING
def test_a_streak_is_the_projected_path(readout_s):
    """Setup: bright square of 5 px on a bent path of some 20 px, behind a tilted flat port with a distorted lens.
    Expected: centroid and spread of the streak are those of its projected path, by quadrature. Tolerance: 0.05 px.
    Negative controls: the straight path between its ends, and the other kind of shutter."""
    scene = scene_on_path(readout_s)
    view = film.view_of(scene)
    range_m = geometry.geometry(scene, view)["range"]
    _, poses = exposure_poses(scene, steps=motion.exposure_steps(scene, view, range_m))
    found = np.stack([moments(centres(), image) for image in images(scene, view, poses)])
    assert agree(found, projected(scene, scene.rig.poses_at, scene.shutter)).max() < 0.05

    # negative controls
    half_s = scene.shutter.span_s / 2
    ends = scene.rig.poses_at(np.array([-half_s, half_s]))
    straight = projected(
        scene, lambda t: pose.interpolate(ends, knots_s=np.array([-half_s, half_s]), times_s=t), scene.shutter
    )
    assert agree(found, straight).max() > 0.2
    other = dataclasses.replace(scene.shutter, readout_s=0.03 - readout_s)
    assert agree(found, projected(scene, scene.rig.poses_at, other)).max() > 0.2


@ROLLING
@pytest.mark.parametrize("part", [0, 3], ids=["first", "last"])
def test_a_slice_of_the_streak_lies_where_the_path_is_then(readout_s, part):
    """Expected: of the streak's quarters in time, first and last have the centroids of the path's; 0.05 px. Negative
    control: the neighbouring quarter."""
    scene = scene_on_path(readout_s)
    view, whole = film.view_of(scene), scene.shutter
    quarter = dataclasses.replace(whole, exposure_s=whole.exposure_s / 4)
    shift_s = (part - 1.5) * quarter.exposure_s

    def poses_at(times_s, later_s=shift_s):
        return scene.rig.poses_at(times_s + later_s)

    poses = poses_at(quarter.step_times_s(400))
    found = images(scene, dataclasses.replace(view, shutter=quarter), poses)
    found = np.stack([moments(centres(), image) for image in found])
    assert agree(found, projected(scene, poses_at, quarter)).max() < 0.05
    next_s = shift_s + (quarter.exposure_s if part == 0 else -quarter.exposure_s)
    assert agree(found, projected(scene, lambda t: poses_at(t, next_s), quarter))[0] > 0.5


@ROLLING
def test_flow_and_sharp_image_say_where_the_square_is_in_the_picture(readout_s):
    """Setup: exposures of a hundredth at start, middle and end. Expected: the square's centroid is where `see` has its
    middle, and the momentary view shows it at phase 0; 0.05 px. Negative control: with a rolling shutter, the place
    that the pose at mid-exposure gives."""
    scene = scene_on_path(readout_s)
    view, whole = film.view_of(scene), scene.shutter
    sharp_view, sharp_poses = motion.momentary(scene, view, steps=800)
    centre = pose.apply(square(), np.zeros(3))
    for phase in (-0.5, 0.0, 0.5):
        brief = dataclasses.replace(whole, exposure_s=1e-9)

        def at(times_s, later_s=phase * whole.exposure_s):
            return scene.rig.poses_at(times_s + later_s)

        if phase == 0:
            found = images(scene, sharp_view, sharp_poses)
        else:
            found = images(scene, dataclasses.replace(view, shutter=brief), at(brief.step_times_s(800)))
        found = np.stack([moments(centres(), image)[:2] for image in found])
        seen = see(centre, lens=scene.lens, poses_at=scene.rig.poses_at, shutter=whole, phase=phase)[0]
        assert agree(found, seen).max() < 0.05
        at_once = scene.lens.project(pose.apply(pose.inverse(at(np.zeros(1))[0]), centre))[0]
        assert (agree(found, at_once).max() > 0.3) == (readout_s > 0)


@ROLLING
def test_flow_belongs_to_the_points_that_the_buffers_hold(readout_s):
    """Expected: what a pixel sees in the middle of its row's exposure is, `flow` further, where `see` has it; 0.01 px
    (range of float32, flow rounded). Negative control: flow and range as with the other shutter."""
    scene = scene_on_path(readout_s)
    view = film.view_of(scene)
    buffers = geometry.geometry(scene, view)
    start, end = motion.flow(scene, view, buffers["range"])
    origins, directions = geometry.pixel_rays(scene, view)
    points = origins + directions * buffers["range"][..., None]

    def errors_px(shutter):
        moments = {"lens": scene.lens, "poses_at": scene.rig.poses_at, "shutter": shutter}
        pairs = ((start, -0.5), (np.zeros_like(start), 0.0), (end, 0.5))
        return max(np.nanmax(np.abs(see(points, phase=p, **moments)[0] - (centres() + f))) for f, p in pairs)

    assert errors_px(scene.shutter) < 0.01
    assert errors_px(dataclasses.replace(scene.shutter, readout_s=0.03 - readout_s)) > 0.5
    assert np.linalg.norm(end - start, axis=-1).min() > 3


def test_a_straight_trajectory_renders_as_the_same_motion():
    """Setup: the same line as `trajectory` and as `motion`. Expected: the same image, to the last bit."""
    still = {"position_m": (0.0, 0.0, -1.0), "look_at_m": (0.0, 1.0, -1.0)}
    by_motion = scene_on_path(0.0, **still, motion={"velocity_m_per_s": (10.0, 0.0, 0.0)})
    line = {
        "times_s": (-0.03, 0.01),
        "positions_m": ((-0.3, 0.0, -1.0), (0.1, 0.0, -1.0)),
        "look_at_m": ((-0.3, 1.0, -1.0), (0.1, 1.0, -1.0)),
    }
    by_trajectory = scene_on_path(0.0, trajectory=line)
    found = [exposure_poses(scene, steps=50)[1].astype(np.float32) for scene in (by_motion, by_trajectory)]
    assert found[0] == pytest.approx(found[1], abs=1e-7)
    pictures = [
        images(scene, film.view_of(scene), poses.astype(float))[:1]
        for scene, poses in zip((by_motion, by_trajectory), found, strict=True)
    ]
    assert pictures[0] == pytest.approx(pictures[1], abs=1e-2)
    assert np.abs(pictures[0] - pictures[1]).mean() < 1e-5
