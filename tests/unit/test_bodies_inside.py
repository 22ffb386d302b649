"""What is inside what: winding numbers and distances of meshes, housings in each other, poses of moving bodies."""

import numpy as np
import pytest

from uwsim.camera import pose
from uwsim.render import placement
from uwsim.render.housing_overlap import cylinders_overlap, inside_cylinder
from uwsim.scene.bodies import Rectangle
from uwsim.scene.housing import Housing
from uwsim.scene.snow import FACES, OCTAHEDRON, octahedra

HALF_M = np.array([0.5, 0.4, 0.3])
_CORNERS = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]) * HALF_M
_OUTWARD = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7),
            (2, 7, 6), (3, 0, 4), (3, 4, 7)]  # fmt: skip
BOX = _CORNERS[np.array(_OUTWARD)]


@pytest.fixture
def points() -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (2000, 3))


def test_the_winding_number_is_1_inside_a_closed_body_and_0_outside(points):
    """Round-off. Negative control: faces that look inwards, a room, have -1."""
    inside = np.all(np.abs(points) < HALF_M, axis=-1)
    assert inside.sum() > 50
    np.testing.assert_allclose(placement.winding_number(points, BOX), inside, atol=1e-12)
    np.testing.assert_allclose(placement.winding_number(points, BOX[:, ::-1]), -1.0 * inside, atol=1e-12)


def test_the_distance_is_that_to_the_nearest_face_edge_or_corner(points):
    """Expected: the closed form of a box. Round-off. Negative control: the distance to its corners."""
    beyond = np.abs(points) - HALF_M
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=-1)
    expected = np.where(np.all(beyond < 0, axis=-1), -beyond.max(axis=-1), outside)
    np.testing.assert_allclose(placement.distance_m(points, BOX), expected, atol=1e-12)
    corners = np.linalg.norm(points[:, None] - _CORNERS, axis=-1).min(axis=-1)
    assert np.abs(corners - expected).max() > 0.1


def test_only_meshes_without_a_gap_and_of_one_orientation_are_closed():
    turned = np.concatenate([BOX[:1, ::-1], BOX[1:]])
    flat = np.concatenate([BOX, BOX[:1, [0, 1, 1]]])
    assert placement.is_closed(BOX) and placement.is_closed(BOX[:, ::-1]) and placement.is_closed(flat)
    assert placement.is_closed(OCTAHEDRON[FACES])
    assert not placement.is_closed(BOX[1:]) and not placement.is_closed(turned)


@pytest.mark.parametrize(
    ("at_m", "turn_deg", "overlap"),
    [
        ((0.0, 0.0, 0.0), (0, 0, 0), True),
        ((0.16, 0.0, 0.0), (0, 0, 0), False),
        ((0.149, 0.0, 0.0), (0, 0, 0), True),
        ((0.15, 0.0, 0.0), (0, 0, 0), False),  # they touch
        ((0.0, 0.0, -0.21), (0, 0, 0), False),
        ((0.0, 0.0, -0.19), (0, 0, 0), True),
        ((0.25, 0.0, -0.1), (0, 90, 0), True),
        ((0.31, 0.0, -0.1), (0, 90, 0), False),
        ((0.2, 0.0, 0.06), (0, 45, 0), True),
        ((0.2, 0.0, 0.06), (0, -45, 0), False),
    ],
)
def test_housings_in_each_other(at_m, turn_deg, overlap):
    """Cylinders of 0.1 m and 0.05 m radius, 0.2 m long: side by side, behind each other, across."""
    one, other = (np.eye(4), Housing(radius_m=0.1, length_m=0.2)), Housing(radius_m=0.05, length_m=0.2)
    there = pose.rotated(pose.from_parts(np.eye(3), at_m), turn_deg)
    assert cylinders_overlap(one, (there, other)) is overlap
    assert cylinders_overlap((there, other), one) is overlap


def test_what_stands_in_the_front_face_is_not_inside_the_housing():
    housing = Housing(radius_m=0.1, length_m=0.2)
    points = np.array([[0, 0, 0], [0, 0, -0.01], [0.11, 0, -0.01], [0, 0, 0.01], [0, 0, -0.21], [0.09, 0, -0.19]])
    assert inside_cylinder(points, np.eye(4), housing).tolist() == [False, True, False, False, False, True]


def test_octahedra_have_the_surface_of_their_spheres_and_look_outwards():
    """Round-off. Cauchy's theorem makes the mean silhouette that of the sphere."""
    radii, middles = np.array([0.5, 2.0]), np.array([[0.0, 0, 0], [9, 0, 0]])
    turns = pose.rotated(np.eye(4), (10, 20, 30))[:3, :3][None].repeat(2, axis=0)
    vertices, faces = octahedra(middles, radii, turns)
    triangles = vertices[faces].reshape(2, 8, 3, 3)
    normals = np.cross(triangles[:, :, 1] - triangles[:, :, 0], triangles[:, :, 2] - triangles[:, :, 0]) / 2
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1).sum(axis=1), 4 * np.pi * radii**2, rtol=1e-12)
    assert np.all(np.sum(normals * (triangles.mean(axis=2) - middles[:, None]), axis=-1) > 0)


def body(**place) -> Rectangle:
    return Rectangle(name="body", kind="rectangle", width_m=1, height_m=1, reflectance=0.5, **place)


def test_a_body_moves_along_and_about_the_world_s_axes():
    """A body turned away from the world's axes: velocity as given, and a turn of 90 deg about the world's z."""
    place = {"position_m": (1.0, 2.0, -3.0), "towards_m": (0.0, 0.0, -1.0)}
    still = body(**place).world_from_body
    motion = {"velocity_m_per_s": (1.0, 0.0, 0.0), "rotation_deg_per_s": (0.0, 0.0, 90.0)}
    before, middle, after = body(**place, motion=motion).poses_at(np.array([-1.0, 0.0, 1.0]))
    np.testing.assert_allclose(middle, still, atol=1e-12)
    np.testing.assert_allclose([before[:3, 3], after[:3, 3]], [(0, 2, -3), (2, 2, -3)], atol=1e-12)
    np.testing.assert_allclose(after[:2, :3], np.stack([-still[1, :3], still[0, :3]]), atol=1e-12)
    np.testing.assert_allclose(before[2, :3], still[2, :3], atol=1e-12)


def test_a_trajectory_that_faces_a_point_is_the_body_that_faces_it():
    path = {"times_s": (-1, 1), "positions_m": ((0, 2, -3), (2, 2, -3)), "look_at_m": ((0, 0, -1), (0, 0, -1))}
    moving = body(trajectory={key: tuple(map(float, v)) if key == "times_s" else v for key, v in path.items()})
    for time_s, at in ((-1.0, (0, 2, -3)), (1.0, (2, 2, -3))):
        facing = body(position_m=tuple(map(float, at)), towards_m=(0.0, 0.0, -1.0)).world_from_body
        np.testing.assert_allclose(moving.poses_at(np.array([time_s]))[0], facing, atol=1e-12)
    assert moving.moves and not body(position_m=(0.0, 0.0, -1.0)).moves
