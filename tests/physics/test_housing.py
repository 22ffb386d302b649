"""A housing is a black closed cylinder: rays meet it where a cylinder is, and behind it no light arrives."""

import numpy as np
import pytest

from tests.physics import lamp_plugin, scenes
from uwsim.camera import pose

COUNT = 200_000
RADIUS_M, LENGTH_M = 0.05, 0.12
INSET_M = 1e-3 * RADIUS_M


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def housings(*poses, dome_radius_m=0.0, radius_m=RADIUS_M, length_m=LENGTH_M):
    from uwsim.render.housing import Housings

    return Housings([(np.stack(poses)[:, :3, :], radius_m, length_m, dome_radius_m)])


def rays(origin, direction, *, time=0.0, maxt=None):
    import mitsuba as mi

    o, d = (np.asarray(v, np.float32).T for v in (origin, direction))
    found = mi.Ray3f(mi.Point3f(o), mi.Vector3f(d), time, mi.Spectrum(550.0))
    if maxt is not None:
        found.maxt = mi.Float(np.asarray(maxt, np.float32))
    return found


def towards_a_ball(count, *, distance_m, seed=3, radius_m=0.12):
    """Rays from a sphere of `distance_m` about the origin to points in a ball about it."""
    rng = np.random.default_rng(seed)
    start, aim = (v / np.linalg.norm(v, axis=1)[:, None] for v in rng.normal(size=(2, count, 3)))
    start, aim = distance_m * start, radius_m * np.cbrt(rng.random((count, 1))) * aim + [0, 0, -LENGTH_M / 2]
    return start, (aim - start) / np.linalg.norm(aim - start, axis=1)[:, None]


def mitsuba_cylinder(world_from_front, *, length_m=LENGTH_M):
    import mitsuba as mi

    inner = RADIUS_M - INSET_M
    place = mi.ScalarTransform4f(world_from_front)
    ends = (-INSET_M, INSET_M - length_m)
    shapes = {"type": "scene", "side": {"type": "cylinder", "p0": [0, 0, ends[1]], "p1": [0, 0, ends[0]],
                                        "radius": inner, "to_world": place}}  # fmt: skip
    for name, z in zip(("front", "back"), ends, strict=True):
        end = pose.from_parts(np.eye(3), (0, 0, z)) @ np.diag([inner, inner, 1, 1])
        shapes[name] = {"type": "disk", "to_world": mi.ScalarTransform4f(world_from_front @ end)}
    return mi.load_dict(shapes)


@pytest.mark.parametrize("distance_m", [0.3, 5.0])
def test_rays_meet_it_where_a_cylinder_is(distance_m):
    """Setup: 200,000 rays into a ball about a tilted cylinder, from 0.3 and from 5 m. Expected: the distance to
    Mitsuba's cylinder and two disks, and hits that lie on the surface. Tolerance: round-off, 2e-5 of the distance
    against Mitsuba (whose hits are 1e-5 off the surface), 1e-6 of it to the surface; 1 ray in 100 may graze it and
    differ more. Negative control: a cylinder 5 mm shorter."""
    turned = pose.rotated(np.eye(4), (30, -50, 10))
    start, direction = towards_a_ball(COUNT, distance_m=distance_m)
    ray = rays(start, direction)
    found = housings(turned).intersect(ray).numpy()
    for length_m, agrees in ((LENGTH_M, True), (LENGTH_M - 0.005, False)):
        scene = mitsuba_cylinder(turned, length_m=length_m)  # must outlive the evaluation
        expected = scene.ray_intersect(ray).t.numpy()
        both = np.isfinite(found) & np.isfinite(expected)
        assert 0.3 < both.mean() < 0.9
        apart = np.abs(found[both] - expected[both]) > 2e-5 * distance_m
        differing = np.sum(np.isfinite(found) != np.isfinite(expected)) + np.sum(apart)
        assert (differing <= COUNT / 100) == agrees
    hit = np.isfinite(found)
    local = (ray.o.numpy().T + found[:, None].astype(float) * ray.d.numpy().T)[hit] @ turned[:3, :3]
    faces = np.minimum(np.abs(local[:, 2] + INSET_M), np.abs(local[:, 2] + LENGTH_M - INSET_M))
    off = np.minimum(np.abs(np.hypot(local[:, 0], local[:, 1]) - RADIUS_M + INSET_M), faces)
    assert np.quantile(off, 0.99) < 1e-6 * distance_m + 1e-7


def test_a_dome_is_a_ball_before_the_front_face():
    """Setup: rays from 0.5 m. Expected: the nearer of ball (closed form) and cylinder. Tolerance: round-off 2e-6 m;
    1 ray in 10,000 may pass an edge. Negative control: a ball 1 % larger."""
    start, direction = towards_a_ball(COUNT, distance_m=0.5)
    found = housings(np.eye(4), dome_radius_m=0.04).intersect(rays(start, direction)).numpy()
    cylinder = housings(np.eye(4)).intersect(rays(start, direction)).numpy()
    assert np.mean(found < cylinder) > 0.05
    for radius_m, agrees in ((0.04, True), (0.0404, False)):
        middle = -np.sum(start * direction, axis=1)
        left = (radius_m * 0.999) ** 2 - np.sum((start + middle[:, None] * direction) ** 2, axis=1)
        ball = np.where(left > 0, middle - np.sqrt(np.maximum(left, 0)), np.inf)
        expected = np.minimum(ball, cylinder)
        same = (found == expected) | (np.abs(found - np.where(np.isfinite(expected), expected, 0)) < 1e-5)
        assert (np.mean(~same) <= 1e-4) == agrees


@pytest.mark.parametrize("place_m", [(0.0, 0.0, 0.0), (3.0, -40.0, -100.0)])
def test_what_starts_or_ends_on_the_front_face_does_not_meet_it(place_m):
    """Setup: points of the front face (up to its edge) and of a dome; rays out of them, and light from there, near the
    origin and 100 m from it. Expected: no hit outwards, a hit at once inwards, nothing blocked on the way to them.
    Negative control: a segment that ends 1 mm behind the face is blocked."""
    import mitsuba as mi

    rng = np.random.default_rng(8)
    world_from_front = pose.looking_at(place_m, np.add(place_m, (0.3, 1.0, -0.2)))
    held = housings(world_from_front)
    radius, turn = RADIUS_M * np.sqrt(rng.random(COUNT)), rng.uniform(0, 2 * np.pi, COUNT)
    local = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn], axis=1)
    face = pose.apply(world_from_front, local).astype(np.float32)
    cosine, azimuth = rng.uniform(0.02, 1, COUNT), rng.uniform(0, 2 * np.pi, COUNT)
    sine = np.sqrt(1 - cosine**2)
    outward = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1) @ world_from_front[:3, :3].T
    assert not np.isfinite(held.intersect(rays(face, outward)).numpy()).any()
    inwards = held.intersect(rays(face, -world_from_front[:3, 2] * np.ones((COUNT, 1)))).numpy()
    inside = radius < 0.995 * RADIUS_M
    assert inwards[inside].max() < 1e-3 * RADIUS_M + 5e-4

    far = face.astype(float) + outward
    back = (face - far) / np.linalg.norm(face - far, axis=1)[:, None]
    length = np.linalg.norm(face - far, axis=1)
    assert not held.blocks(rays(far, back, maxt=length)).numpy().any()
    behind = length + 1e-3 / cosine
    assert held.blocks(rays(far, back, maxt=behind)).numpy()[inside & (cosine > 0.3)].mean() > 0.9

    domed = housings(world_from_front, dome_radius_m=0.04)
    on_dome = pose.apply(world_from_front, 0.04 * np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], 1))
    assert not np.isfinite(domed.intersect(rays(on_dome, outward)).numpy()).any()
    assert np.all(domed.intersect(rays(on_dome, -outward), mi.Bool(True)).numpy() < 1e-3)


def test_it_moves_with_the_time_of_the_ray():
    """Setup: two poses 1 m apart, rays at both halves of the exposure. Expected: hit in the one, none in the other."""
    here, there = np.eye(4), pose.from_parts(np.eye(3), (1.0, 0, 0))
    held = housings(here, there)
    start = np.array([[0.0, 0, 1], [1.0, 0, 1]])
    for time, hit in ((0.2, [True, False]), (0.7, [False, True])):
        found = held.intersect(rays(start, [[0, 0, -1.0]] * 2, time=time)).numpy()
        assert np.isfinite(found).tolist() == hit
        np.testing.assert_allclose(found[np.array(hit)], 1 + INSET_M, atol=2e-6)


def test_points_behind_a_housing_are_dark():
    """Setup: a lamp that shines to all sides, bare and behind a flat window, points around it. Expected: with its
    housing, light in front of its face only; without (negative control), the bare lamp lights the points behind."""
    points = np.random.default_rng(2).uniform(-0.5, 0.5, (20_000, 3)).astype(np.float32)
    at = lamp_plugin.at(points)
    for window in (None, {"air_gap_m": 0.01, "thickness_m": 0.005, "radius_m": 0.03}):
        lamp = lamp_plugin.lamp(
            window=window, half_angle_deg=None, beam={"angles_deg": [0, 180], "values": [1, 1]},
            housing={"radius_m": 0.05, "length_m": 0.1},
        )  # fmt: skip
        light, ds = lamp_plugin.irradiance(lamp_plugin.emitter(lamp), points)
        front = np.linalg.inv(lamp.rig_from_lamp) @ lamp.rig_from_front
        held = housings(front, radius_m=lamp.housing.radius_m, length_m=lamp.housing.length_m)
        shadow = held.blocks(at.spawn_ray_to(ds.p)).numpy()
        before, behind = points[:, 2] > front[2, 3], points[:, 2] < front[2, 3] - 1e-3
        assert not np.any((light > 0)[behind] & ~shadow[behind])
        assert not np.any(shadow[before & (light > 0)])
        assert np.any(light[before] > 0)
        assert np.all(light[behind] > 0) == (window is None)  # negative control: what would arrive without it


def test_a_wall_behind_a_housing_gets_no_light():
    """Setup: a lamp that shines to all sides beside the camera's view, its back to the wall, in absorbing water.
    Expected: with its housing the wall is black, to the last bit. Negative control: without it the wall is lit."""
    values = {
        "half_angle_deg": None,
        "beam": {"angles_deg": [0, 180], "values": [1, 1]},
        "position_m": (0.2, 0.0, 0.3),
        "look_at_m": (0.2, 0.0, 0.0),
    }
    water = scenes.water(absorption_per_m=0.5)
    for housing, lit in (({"radius_m": 0.05, "length_m": 0.1}, False), (None, True)):
        scene = lamp_plugin.wall_lit_by(lamp_plugin.lamp(**values, housing=housing), distance_m=0.6)
        found = scenes.replicates(scene, water=water, samples=4, count=2)
        assert np.all((found > 0) == lit)
