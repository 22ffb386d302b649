"""Bodies in motion: sub-frames against the time-sampled sensor where only the motion between body and rig counts."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.references.monte_carlo import assert_mean_matches
from uwsim.camera import pose
from uwsim.camera.shutter import see
from uwsim.render import film, geometry, motion, transport
from uwsim.render.accumulate import Accumulator
from uwsim.render.build import build
from uwsim.scene.models import Scene

WIDTH_PX, HEIGHT_PX = 24, 16
TIME_S = 0.01
# an uneven way, faster towards the end and turning: mirrored, it is another picture
PATH = {
    "times_s": (-0.01, 0.0, 0.01),
    "positions_m": ((-0.06, 1.0, -1.02), (0.0, 1.0, -1.0), (0.24, 0.9, -0.98)),
    "look_at_m": ((0.3, 0.0, -1.0), (0.0, 0.0, -1.0), (-0.6, 0.0, -1.0)),
}


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene_with(*, body: dict | None = None, more: tuple[dict, ...] = (), **rig) -> Scene:
    """A lamp beside the camera, and a bright plate before nothing, by default on the uneven way."""
    values = scenes.wall(distance_m=1.0).model_dump()
    plate = {"name": "plate", "kind": "rectangle", "width_m": 0.12, "height_m": 0.1, "reflectance": 0.8}
    camera = {"width_px": WIDTH_PX, "height_px": HEIGHT_PX, "horizontal_fov_deg": 30.0}
    lamps = scenes.wall(distance_m=1.0, lamp_m=(0.15, 0.0, 0.0)).model_dump()["rig"]["lamps"]
    place = rig or {"position_m": (0.0, 0.0, -1.0), "look_at_m": (0.0, 1.0, -1.0)}
    return Scene.model_validate(
        {key: values[key] for key in ("name", "description", "water")}
        | {"bodies": (plate | (body or {"trajectory": PATH}), *more), "rig": place | {"camera": camera, "lamps": lamps}}
        | {"exposure": {"time_s": TIME_S}}
    )


def seen_from_the_body(scene: Scene, times_s: np.ndarray, *, against: bool = True) -> np.ndarray:
    """Return the poses of a rig (n, 4, 4) that sees a body at rest as `scene`'s rig sees the moving one.

    `against` False: of a rig that moves as the body does, the wrong way.
    """
    body = scene.bodies[0]
    then = body.poses_at(times_s) @ pose.inverse(body.world_from_body)
    return (pose.inverse(then) if against else then) @ scene.rig.world_from_rig


def batches(scene: Scene, poses: np.ndarray, *, water, parts: int, samples: int, count: int, seed: int) -> np.ndarray:
    """Return the pictures (count, H, W) of independent batches, sum of the bands."""
    built = build(scene, water=water, rig_poses=poses, sub_frames=parts)
    accumulator = Accumulator(
        built, film.view_of(scene), transport.estimate(built), samples_per_batch=samples, seed=seed
    )
    found, before = [], 0.0
    for _ in range(count):
        accumulator.add_batch()
        found.append(accumulator.sums.sums[0].sum(axis=-1) - before)
        before = accumulator.sums.sums[0].sum(axis=-1).copy()
    return np.stack(found)


def regions(images: np.ndarray) -> np.ndarray:
    """Return means over 2 rows and 6 columns of regions, where the plate comes by."""
    inner = images[..., 4:12, :]
    return inner.reshape(*images.shape[:-2], 2, 4, 6, 4).mean(axis=(-1, -3))


WATERS = {
    "empty": None,
    "water": scenes.water(absorption_per_m=0.2, scattering_per_m=0.2, g=0.8),
}


@pytest.mark.parametrize("name", ["empty", pytest.param("water", marks=pytest.mark.slow)])
def test_a_moving_body_is_a_rig_that_moves_the_other_way(name):
    """Setup: plate on an uneven, turning way before a rig at rest; and the plate at rest before the rig on the inverse
    way, with the time-sampled sensor. Lamp and camera ride together and the water is the same everywhere, so only the
    motion between body and rig counts. Expected: the same means of the regions where the plate comes by. Tolerance:
    Monte Carlo, 1 % standard error (4 % in water), and three of the other's. Negative control: a rig that moves as
    the body does, off by more than 30 %."""
    scene, water = scene_with(), WATERS[name]
    view = film.view_of(scene)
    parts = motion.sub_frames(scene, view)
    assert 24 <= parts <= 64
    still = scene.rig.world_from_rig[None]
    per_part, by_time, limit = (8, 1024, 0.01) if water is None else (4, 512, 0.04)
    found = regions(batches(scene, still, water=water, parts=parts, samples=per_part * parts, count=8, seed=1))

    def by_rig(against, count=8):
        poses = seen_from_the_body(scene, scene.shutter.step_times_s(400), against=against)
        return regions(batches(scene, poses, water=water, parts=1, samples=by_time, count=count, seed=2))

    other = by_rig(True)
    expected = other.mean(axis=0)
    lit = expected > 0.1 * expected.max()
    assert lit.sum() >= 4
    own_error = float((other.std(axis=0, ddof=1)[lit] / np.sqrt(8) / expected[lit]).max())
    assert own_error < limit
    assert_mean_matches(found[:, lit], expected[lit], max_relative_standard_error=limit, model_tolerance=3 * own_error)
    wrong = by_rig(False, count=2).mean(axis=0)
    assert np.abs(wrong / np.where(lit, expected, 1) - 1)[lit].max() > 0.3


def test_too_few_sub_frames_show():
    """Expected: pictures by the number of sub-frames asked for and by twice as many differ by less than 3 % of the
    picture's rms, Monte Carlo included. Negative control: with three sub-frames by more than 10 %."""
    scene = scene_with()
    still, parts = scene.rig.world_from_rig[None], motion.sub_frames(scene, film.view_of(scene))

    def picture(count):
        return batches(scene, still, water=None, parts=count, samples=768, count=1, seed=3)[0]

    fine = picture(2 * parts)
    enough, few = (np.sqrt(np.mean((picture(n) - fine) ** 2) / np.mean(fine**2)) for n in (parts, 3))
    assert enough < 0.03
    assert few > 0.1


def test_batches_run_through_all_sub_frames_and_go_on_from_stored_sums():
    """Expected: samples per batch are raised to a multiple of the sub-frames; two batches in one go have the bytes of
    one and one, and compile nothing after the first. Negative control: without a moving body nothing is raised."""
    import drjit as dr

    scene = scene_with()
    poses = scene.rig.world_from_rig[None]

    def accumulator(sums=None):
        built = build(scene, water=None, rig_poses=poses, sub_frames=10)
        view = film.view_of(scene)
        return Accumulator(built, view, transport.estimate(built), samples_per_batch=16, seed=4, sums=sums)

    whole = accumulator()
    assert whole.samples_per_batch == 20 and len(whole.launches) == 10
    whole.add_batch()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        whole.add_batch()
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert kernels and all(kernel["cache_hit"] for kernel in kernels)
    first = accumulator()
    first.add_batch()
    second = accumulator(first.sums)
    second.add_batch()
    assert whole.sums.sums.tobytes() == second.sums.sums.tobytes()
    rest = scene_with(body={"position_m": (0.0, 1.0, -1.0)})
    assert motion.sub_frames(rest, film.view_of(rest)) == 1
    built = build(rest, water=None, rig_poses=poses)
    assert Accumulator(built, film.view_of(rest), None, samples_per_batch=16, seed=4).samples_per_batch == 16


def test_flow_follows_the_body_and_the_buffers_are_at_mid_exposure():
    """Setup: the plate on its way before a wall at rest, a rig in motion. Expected: the plate's pixels have the flow
    of points fixed to it, 0.01 px (range of float32, flow rounded), the wall's that of the rig's motion; the range is
    that of a plate at rest at mid-exposure. Negative control: the rig's motion alone is off by more than a pixel."""
    wall = {
        "name": "wall", "kind": "rectangle", "width_m": 3.0, "height_m": 3.0, "reflectance": 0.5,
        "position_m": (0.0, 1.5, -1.0), "towards_m": (0.0, 0.0, -1.0),
    }  # fmt: skip
    rig = {"position_m": (0.0, 0.0, -1.0), "look_at_m": (0.0, 1.0, -1.0)}
    rig["motion"] = {"velocity_m_per_s": (0.0, 8.0, 0.0)}
    scene = scene_with(more=(wall,), **rig)
    view = film.view_of(scene)
    buffers = geometry.geometry(scene, view)
    at_rest = {"position_m": (0.0, 1.0, -1.0), "towards_m": (0.0, 0.0, -1.0)}
    still = scene_with(body=at_rest, more=(wall,), **rig)
    assert np.array_equal(buffers["range"], geometry.geometry(still, view)["range"])
    plate = buffers["instance"] == 1
    assert 20 < plate.sum() < 200
    origins, directions = geometry.pixel_rays(scene, view)
    points = origins + directions * buffers["range"][..., None]
    centres = see(points, lens=view.lens, poses_at=scene.rig.poses_at, shutter=view.shutter)[0]
    flows = motion.flow(scene, view, buffers["range"], buffers["instance"])
    off_px = 0.0
    for found, phase in zip(flows, (-0.5, 0.5), strict=True):
        then = scene.bodies[0].poses_at(np.array([phase * TIME_S]))[0] @ pose.inverse(scene.bodies[0].world_from_body)
        settings = {"lens": view.lens, "poses_at": scene.rig.poses_at, "shutter": view.shutter, "phase": phase}
        with_body = see(pose.apply(then, points), **settings)[0] - centres
        by_rig = see(points, **settings)[0] - centres
        assert np.abs(found - with_body)[plate].max() < 0.01
        assert np.abs(found - by_rig)[~plate].max() < 0.01
        off_px = max(off_px, np.abs(found - by_rig)[plate].max())
    assert off_px > 1.0
    with pytest.raises(ValueError, match="no instance buffer"):
        motion.flow(scene, view, buffers["range"])


BENT = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float nx
property float ny
property float nz
element face 2
property list uchar int vertex_indices
end_header
-0.1 -0.1 0 -0.6 0 0.8
0.1 -0.1 0 0.6 0 0.8
0.1 0.1 0.02 0.6 0 0.8
-0.1 0.1 0.02 -0.6 0 0.8
3 0 1 2
3 0 2 3
"""
KINDS = {
    "mesh": {"kind": "mesh", "file": "bent.ply", "reflectance": 0.5},
    "relief": {"kind": "heightfield", "file": "relief.png", "width_m": 0.2, "height_m": 0.2, "relief_m": 0.03,
               "reflectance": 0.5},
    "board": {"kind": "marker_board", "columns": 2, "rows": 1, "marker_size_m": 0.08, "gap_m": 0.01},
    "checker": {"kind": "colorchecker", "width_m": 0.2},
    "snow": {"kind": "marine_snow", "low_m": (-0.1, 0.9, -1.1), "high_m": (0.1, 1.1, -0.9), "count": 400,
             "diameters_m": (0.01, 0.01), "reflectance": 0.5, "seed": 1},
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_part_of_the_exposure_shows_the_body_where_it_is_then(kind, tmp_path):
    """Setup: a body of each kind that moves and turns, shown in the first and then in the last of four parts. Expected:
    rays meet it where, and with the normals with which, they meet it at rest at mid-exposure after the same motion of
    the rays; 1e-5 m (float32). Negative control: where it is at mid-exposure they do not."""
    import cv2
    import mitsuba as mi

    (tmp_path / "bent.ply").write_text(BENT)
    cv2.imwrite(str(tmp_path / "relief.png"), np.random.default_rng(1).integers(0, 255, (5, 5)).astype(np.uint8))
    body = {"name": "body"} | KINDS[kind]
    body |= {"file": tmp_path / body["file"]} if "file" in body else {}
    body |= {} if kind == "snow" else {"position_m": (0.0, 1.0, -1.0), "towards_m": (0.0, 0.0, -1.0)}
    body |= {"motion": {"velocity_m_per_s": (6.0, 2.0, 0.0), "rotation_deg_per_s": (0.0, 900.0, 900.0)}}
    scene = scene_with()
    scene = Scene.model_validate(scene.model_dump() | {"bodies": (body,)})
    water = WATERS["water"]  # particles need some
    still, parts = scene.rig.world_from_rig[None], 4
    moving = build(scene, water=water, rig_poses=still, sub_frames=parts)
    resting = build(scene, water=water, rig_poses=still)
    across = np.stack(np.meshgrid(np.linspace(-0.1473, 0.1481, 61), np.linspace(-0.1473, 0.1481, 61)), axis=-1).reshape(
        -1, 2
    )
    targets = np.stack([across[:, 0], np.full(len(across), 1.0), -1.0 + across[:, 1]], axis=-1)

    def met(built, motion_of_rays):
        origins = pose.apply(motion_of_rays, targets - (0.0, 0.5, 0.0))
        directions = np.tile(motion_of_rays[:3, 1], (len(targets), 1))
        ray = mi.Ray3f(mi.Point3f(origins.T.astype(np.float32)), mi.Vector3f(directions.T.astype(np.float32)))
        si = built.scene.ray_intersect(ray)
        back = motion_of_rays[:3, :3]  # normals as before the motion
        return si.t.numpy(), si.n.numpy().T @ back, si.sh_frame.n.numpy().T @ back

    then = scene.bodies[0].poses_at(scene.shutter.step_times_s(parts)) @ pose.inverse(scene.bodies[0].world_from_body)
    expected = met(resting, np.eye(4))
    assert 0.02 < np.isfinite(expected[0]).mean() < 0.98
    for part in (0, 3):
        moving.sub_frames.show(part)
        found = met(moving, then[part])
        both = np.isfinite(found[0]) & np.isfinite(expected[0])
        assert np.mean(np.isfinite(found[0]) == np.isfinite(expected[0])) > 0.99  # rays along an edge
        for one, other, limit in zip(found, expected, (1e-5, 1e-3, 1e-3), strict=True):
            assert np.mean(np.abs(one[both] - other[both]) > limit) < 0.02  # rays along an edge
        wrong = met(resting, then[part])
        assert np.mean(~(np.abs(wrong[0][both] - expected[0][both]) < 1e-4)) > 0.1
