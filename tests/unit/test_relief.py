"""Normals and shadows from a range map, against a sphere before a wall."""

import numpy as np

from uwsim.camera.lens import Lens, pixel_centres
from uwsim.restoration import relief

LENS = Lens(K=np.array([[150.0, 0, 80], [0, 150, 60], [0, 0, 1]]))
RADIUS_M, CENTRE_M, WALL_M = 0.2, np.array([0.0, 0.0, 1.0]), 1.5


def sphere():
    """Return (points, directions, seen, which pixels see the sphere)."""
    directions = LENS.rays(pixel_centres(width_px=160, height_px=120))[1]
    along = directions @ CENTRE_M
    inside = along**2 - CENTRE_M @ CENTRE_M + RADIUS_M**2
    hit = inside > 0
    range_m = np.where(hit, along - np.sqrt(np.maximum(inside, 0)), WALL_M / directions[..., 2])
    return range_m[..., None] * directions, directions, np.ones(hit.shape, bool), hit


def test_normals_of_a_sphere_and_a_wall():
    points, directions, seen, hit = sphere()
    found = relief.normals(points, directions, seen)
    expected = np.where(hit[..., None], (points - CENTRE_M) / RADIUS_M, [0, 0, -1.0])
    cosine = np.sum(found * expected, axis=-1)
    facing = np.sum(-directions * expected, axis=-1) > 0.3
    # towards its rim one pixel spans much of the sphere; the shorter side keeps the wall a wall right up to it
    assert np.degrees(np.arccos(np.clip(cosine[facing & hit], -1, 1))).max() < 8
    assert np.degrees(np.arccos(np.clip(cosine[~hit], -1, 1))).max() < 0.1
    # control: the normals are not those of surfaces that face the camera
    assert np.degrees(np.arccos(np.sum(-directions * expected, axis=-1)))[facing & hit].max() > 60


def test_nothing_seen_has_no_normal():
    points, directions, seen, _ = sphere()
    seen[:30] = False
    found = relief.normals(points, directions, seen)
    assert np.all(found[:30] == 0)
    np.testing.assert_allclose(np.linalg.norm(found[30:], axis=-1), 1, atol=1e-6)


def shadow_by_hand(points, lamp):
    """Return where the way to a lamp meets the sphere."""
    way = lamp - points
    length = np.linalg.norm(way, axis=-1)
    along = np.einsum("hwk,hwk->hw", CENTRE_M - points, way) / length
    nearest = np.linalg.norm(CENTRE_M - points - along[..., None] * way / length[..., None], axis=-1)
    return (nearest < RADIUS_M) & (along > 0) & (along < length)


def test_shadow_of_a_sphere_on_a_wall():
    points, _, seen, hit = sphere()
    lamps = np.array([[-0.3, 0.0, 0.3], [0.0, 0.0, 0.0]])
    found = relief.visibility(points, seen, lens=LENS, lamps_m=lamps)
    expected = shadow_by_hand(points, lamps[0])
    wall = ~hit
    assert expected[wall].sum() > 150
    assert np.mean((found[..., 0] < 0.5)[wall & expected]) > 0.75
    assert np.mean((found[..., 0] > 0.5)[wall & ~expected]) > 0.99
    # control: of a lamp in the camera the camera sees no shadow
    assert np.mean(found[..., 1][wall] > 0.5) > 0.99


def test_no_shadow_on_the_side_of_the_lamp():
    points, _, seen, hit = sphere()
    found = relief.visibility(points, seen, lens=LENS, lamps_m=np.array([[-0.3, 0.0, 0.3]]))[..., 0]
    side = ~hit & (points[..., 0] < -0.25)
    assert side.sum() > 1000
    assert np.all(found[side] == 1)
