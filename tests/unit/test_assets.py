"""Computed bodies: the same seed makes the same surface, of the stated size, closed where it should be, real tones."""

import cv2
import numpy as np
import pytest
from pydantic import TypeAdapter

from uwsim.optics import surfaces
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render.placement import is_closed, winding_number
from uwsim.scene import bodies, markers, noise, surface, truth
from uwsim.scene.layouts import MarkerLayout
from uwsim.scene.load import load_scene
from uwsim.scene.targets import CharucoBoard

SEEDED = {
    "stones": {"count": 3, "diameters_m": (0.05, 0.1), "field_m": (0.5, 0.5)},
    "sand": {"width_m": 0.3, "height_m": 0.2},
    "plants": {"count": 2, "field_m": (0.1, 0.1)},
    "rusty_wall": {"width_m": 0.1, "height_m": 0.08},
    "pipe": {"length_m": 0.5, "radius_m": 0.05},
    "rope": {"length_m": 0.4, "diameter_m": 0.02},
    "marker_layout": {"layout": "random_10"},
}
PLAIN = {
    "tank": {"width_m": 2.0, "length_m": 3.0, "depth_m": 1.0, "tile_m": 0.2},
    "siemens_star": {"width_m": 0.3, "diameter_m": 0.25},
    "slanted_edge": {"width_m": 0.2, "height_m": 0.2},
    "charuco_board": {"columns": 7, "rows": 5, "square_m": 0.04, "marker_m": 0.03},
}
CLOSED = ("stones", "pipe", "rope", "marker_layout")


def body(kind, **changes):
    values = SEEDED.get(kind, {}) | PLAIN.get(kind, {}) | ({"seed": 1} if kind in SEEDED else {})
    values |= {"name": "it", "kind": kind, "position_m": (0.0, 0.0, -1.0)} | changes
    return TypeAdapter(bodies.Body).validate_python(values)


@pytest.mark.parametrize("kind", SEEDED)
def test_the_same_seed_makes_the_same_surface_and_another_seed_another(kind):
    first = body(kind).make_parts()
    again, other = body(kind).make_parts(), body(kind, seed=2).make_parts()
    for name, part in first.items():
        assert np.array_equal(part.vertices, again[name].vertices)
        assert np.array_equal(part.faces, again[name].faces)
        assert part.vertex_share is None or np.array_equal(part.vertex_share, again[name].vertex_share)
    differs = [
        not np.array_equal(part.vertices, other[name].vertices)
        or not np.array_equal(part.vertex_share, other[name].vertex_share)
        for name, part in first.items()
    ]
    assert any(differs)


@pytest.mark.parametrize("kind", [*SEEDED, *PLAIN])
def test_surfaces_are_sound(kind):
    """Faces name their vertices, have an area, and every tone and share is a reflectance."""
    for part in body(kind).parts.values():
        assert part.faces.min() >= 0 and part.faces.max() < len(part.vertices)
        a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
        assert np.linalg.norm(np.cross(b - a, c - a), axis=-1).min() > 0
        for tone in part.tones:
            assert tone.shape == WAVELENGTHS_NM.shape and 0 <= tone.min() <= tone.max() <= 1
        for share in (part.vertex_share, part.face_share):
            assert share is None or 0 <= share.min() <= share.max() <= 1


@pytest.mark.parametrize("kind", CLOSED)
def test_solid_bodies_are_closed_and_their_faces_look_outwards(kind):
    triangles = body(kind).triangles
    assert is_closed(triangles)
    assert np.einsum("ni,ni->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) > 0
    assert not is_closed(triangles[:-1])


@pytest.mark.parametrize("kind", ["sand", "rusty_wall", "siemens_star", "slanted_edge", "charuco_board"])
def test_flat_bodies_face_along_z(kind):
    triangles = body(kind).triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.all(normals[:, 2] > 0)


def test_what_is_placed_elsewhere_has_the_same_surface_from_the_cache():
    assert body("stones").parts is body("stones", position_m=(1.0, 2.0, -3.0), rotation_deg=(0.0, 0.0, 90.0)).parts


# ---- sizes ----


def test_a_stone_is_as_long_as_asked_and_sunk_a_little():
    stone = body("stones", count=1, field_m=(0.0, 0.0), diameters_m=(0.2, 0.2))
    extent = np.ptp(stone.triangles, axis=(0, 1))
    assert 0.12 < extent[:2].max() < 0.22
    low, high = stone.triangles[..., 2].min(), stone.triangles[..., 2].max()
    assert -low == pytest.approx(0.12 * (high - low), rel=1e-6)
    assert stone.sizes_m == pytest.approx([0.2])


def test_stones_do_not_overlap():
    many = body("stones", count=12, field_m=(0.6, 0.6), diameters_m=(0.03, 0.15))
    apart = np.linalg.norm(many.places_m[:, None] - many.places_m[None], axis=-1)
    needed = (many.sizes_m[:, None] + many.sizes_m[None]) / 2
    assert np.all((apart >= needed - 1e-12) | np.eye(12, dtype=bool))


def test_ripples_have_their_length_and_height():
    sand = body("sand", width_m=1.8, height_m=0.2, mound_m=0.0, grain_m=0.0, ripple_length_m=0.1, ripple_height_m=0.012)
    rows, columns = sand.shape
    heights = sand.parts["sand"].vertices[:, 2].reshape(rows, columns)
    assert 0.006 < np.ptp(heights) < 0.013
    spectrum = np.abs(np.fft.rfft(heights - heights.mean(), axis=1)).mean(axis=0)
    assert 1.8 / spectrum.argmax() == pytest.approx(0.1, rel=0.3)
    assert abs(heights.mean()) < 1e-12


@pytest.mark.parametrize("phase_deg", [0.0, 90.0, 180.0])
def test_blades_keep_their_length_when_they_sway(phase_deg):
    plants = body("plants", count=1, leaves=1, field_m=(0.0, 0.0), sway_phase_deg=phase_deg)
    line = plants.parts["plants"].vertices.reshape(-1, 3, 3)[:, 1]
    length = np.linalg.norm(np.diff(line, axis=0), axis=-1).sum()
    still = body("plants", count=1, leaves=1, field_m=(0.0, 0.0), lean_deg=0.0, sway_deg=0.0)
    upright = still.parts["plants"].vertices.reshape(-1, 3, 3)[:, 1]
    assert length == pytest.approx(np.linalg.norm(np.diff(upright, axis=0), axis=-1).sum(), rel=0.01)
    assert 0.5 * 0.3 < length < 0.31


def test_plants_lean_with_the_current_and_sway_with_the_phase():
    def tip(**changes):
        return body("plants", count=6, **changes).triangles[..., 0].max()

    assert tip(lean_deg=50.0, sway_deg=0.0) > tip(lean_deg=0.0, sway_deg=0.0) + 0.05
    swayed = [body("plants", sway_phase_deg=phase).triangles for phase in (0.0, 120.0)]
    assert np.abs(swayed[0] - swayed[1]).max() > 0.01
    assert body("plants", sway_phase_deg=360.0).triangles == pytest.approx(body("plants").triangles, abs=1e-9)


def test_pipe_wall_flange_and_rope_have_their_volume():
    def volume(triangles):
        return np.einsum("ni,ni->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6

    tube = np.pi * (0.05**2 - 0.046**2) * 0.5
    assert volume(body("pipe").triangles) == pytest.approx(tube, rel=0.005)
    flanges = 2 * np.pi * (0.07**2 - 0.05**2) * 0.012
    assert volume(body("pipe", flange_m=0.02).triangles) == pytest.approx(tube + flanges, rel=0.01)
    strand = 1 / (1 + 2 / np.sqrt(3))  # of three touching circles in a circle of radius 1
    section = 0.01**2 * (3 * np.pi * strand**2 + (np.sqrt(3) - np.pi / 2) * strand**2)
    assert volume(body("rope").triangles) == pytest.approx(section * 0.4, rel=0.02)  # chords across the grooves
    assert np.ptp(body("rope", sag_m=0.1).triangles[..., 1]) == pytest.approx(0.1, abs=0.021)


def test_one_may_be_in_a_tank_and_in_a_pipe_but_not_in_a_stone():
    middle = np.zeros((1, 3))
    assert winding_number(middle, body("pipe").triangles) == pytest.approx(0, abs=1e-3)
    assert not is_closed(body("tank").triangles)
    stone = body("stones", count=1, field_m=(0.0, 0.0))
    assert winding_number(np.array([[0, 0, 0.01]]), stone.triangles) == pytest.approx(1, abs=1e-3)


def test_a_tank_has_the_joints_of_its_tiles():
    floor = body("tank").parts["floor"]
    a, b, c = np.moveaxis(floor.vertices[floor.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 2
    assert area.sum() == pytest.approx(6.0)
    # joints inside: 9 along 3 m, 14 along 2 m, less where they cross
    joints = 9 * 3 * 0.004 + 14 * 2 * 0.004 - 9 * 14 * 0.004**2
    assert area[floor.face_share == 0].sum() == pytest.approx(joints, rel=1e-6)
    assert body("tank", tile_m=None).parts["floor"].face_share.min() == 1


# ---- targets ----


def raster(target, size_px):
    """Return a target drawn without the renderer, 0 to 255, from the tone of the face below each pixel's centre."""
    part = target.parts["face"]
    scale = np.array([size_px / target.width_m, -size_px / target.width_m])
    corners = part.vertices[:, :2] * scale + [size_px / 2, size_px / 2 * target.height_m / target.width_m]
    image = np.zeros((round(size_px * target.height_m / target.width_m), size_px), np.uint8)
    for (a, b, c), share in zip(corners[part.faces], part.face_share, strict=True):
        low, high = np.floor(np.min([a, b, c], axis=0)).astype(int), np.ceil(np.max([a, b, c], axis=0)).astype(int)
        low = np.maximum(low, 0)
        y, x = np.mgrid[low[1] : high[1], low[0] : high[0]] + 0.5
        sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        inside = np.all(np.array(sides) <= 0, axis=0)  # y is down, so that the turn is the other way
        image[low[1] : high[1], low[0] : high[0]][inside[: len(image) - low[1], : size_px - low[0]]] = int(255 * share)
    return image


def test_a_siemens_star_has_half_of_its_disc_dark_and_its_cycles():
    star = body("siemens_star", cycles=18)
    part = star.parts["face"]
    a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 2
    assert area.sum() == pytest.approx(0.09)
    assert area[part.face_share == 0].sum() == pytest.approx(np.pi * 0.125**2 / 2, rel=1e-3)
    image = raster(star, 600)
    angle = (np.arange(720) + 0.5) * 2 * np.pi / 720
    ring = image[np.rint(300 - 200 * np.sin(angle)).astype(int), np.rint(300 + 200 * np.cos(angle)).astype(int)] > 127
    assert np.sum(np.diff(np.append(ring, ring[0]).astype(int)) != 0) == 36
    assert not ring[5] and ring[25]


def test_a_slanted_edge_is_where_it_says():
    image = raster(body("slanted_edge", angle_deg=10.0), 401) > 127
    edge = (~image).sum(axis=1)
    rows = (200.5 - (np.arange(401) + 0.5)) / 401
    assert edge[5:-5] / 401 - 0.5 == pytest.approx(-np.tan(np.radians(10.0)) * rows[5:-5], abs=2 / 401)


def test_a_charuco_board_is_opencvs():
    board = body("charuco_board", first_id=3)
    assert isinstance(board, CharucoBoard)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    theirs = cv2.aruco.CharucoBoard((7, 5), 0.04, 0.03, dictionary, np.array(board.ids))
    to_body = np.array([1, -1, 1]), np.array([-3.5 * 0.04, 2.5 * 0.04, 0])
    assert np.array(theirs.getObjPoints()) * to_body[0] + to_body[1] == pytest.approx(board.corners_m, abs=1e-7)
    inner = theirs.getChessboardCorners() * to_body[0] + to_body[1]
    assert inner == pytest.approx(board.chessboard_corners_m, abs=1e-7)
    image = cv2.resize(raster(board, 1200), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    corners, ids, _, marker_ids = cv2.aruco.CharucoDetector(theirs).detectBoard(image)
    assert sorted(marker_ids.ravel()) == list(board.ids)
    assert ids.ravel().tolist() == list(range(24))
    scale = 600 / board.width_m
    expected = board.chessboard_corners_m[:, :2] * [scale, -scale] + [300, 300 * board.height_m / board.width_m] - 0.5
    assert corners.reshape(-1, 2) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("name", ["DICT_APRILTAG_36h11", "DICT_APRILTAG_16h5"])
def test_boards_draw_apriltags(name):
    """Each is found again by OpenCV in the picture of its modules."""
    board = body("marker_board", dictionary=name, columns=3, rows=2, marker_size_m=0.1, gap_m=0.02)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    for number in board.ids:
        drawn = np.kron(markers.modules(name, number), np.ones((12, 12)))
        image = np.pad((255 * drawn).astype(np.uint8), 30, constant_values=255)
        assert cv2.aruco.ArucoDetector(dictionary).detectMarkers(image)[1].ravel().tolist() == [number]


# ---- layouts ----


@pytest.mark.parametrize(
    ("layout", "count"), [("bipyramid_6", 6), ("pyramid_5", 5), ("stereo_4", 4), ("planar_4", 4), ("random_10", 10)]
)
def test_layouts_have_their_points(layout, count):
    found = body("marker_layout", layout=layout, seed=3 if layout == "random_10" else None, edge_m=0.1)
    points = found.points_m
    assert points.shape == (count, 3)
    rank = np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-9)
    assert rank == (2 if layout == "planar_4" else 3)
    if layout == "random_10":
        assert np.abs(points).max() <= 0.5
        return
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    assert apart[apart > 0].min() == pytest.approx(0.1)
    if layout == "bipyramid_6":
        assert points.mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-12)
        assert np.isclose(apart, 0.1).sum() == 24  # 12 edges


def test_a_sphere_has_its_volume_about_its_centre():
    layout = body("marker_layout", layout="planar_4", seed=None, sphere_radius_m=0.01)
    part = layout.parts["spheres"]
    spheres = part.vertices.reshape(4, -1, 3)
    assert spheres.mean(axis=1) == pytest.approx(layout.points_m, abs=1e-9)
    radii = np.linalg.norm(spheres - layout.points_m[:, None], axis=-1)
    assert radii == pytest.approx(np.full_like(radii, 0.01), rel=2e-3)


# ---- refusals ----


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("stones", {"diameters_m": (0.2, 0.1)}, "smallest first"),
        ("stones", {"count": 20, "field_m": (0.1, 0.1), "diameters_m": (0.1, 0.1)}, "do not fit"),
        ("stones", {"bright": "kryptonite"}, r"material \(basalt"),
        ("stones", {"dark": 1.2}, "dark"),
        ("stones", {"roughness": 0.5}, "roughness"),
        ("sand", {"spacing_m": 1e-4}, "vertices"),
        ("sand", {"ripple_length_m": 0.01}, "ripple_length_m"),
        ("sand", {"ripple_height_m": 0.05}, "slides"),
        ("plants", {"width_m": 0.2}, "width_m"),
        ("plants", {"form": "trees"}, "form"),
        ("tank", {"joint_m": 0.15}, "joint_m"),
        ("tank", {"tile_m": 1e-4, "joint_m": 1e-5}, "vertices"),
        ("rusty_wall", {"seam_width_m": 0.1}, "seam_width_m"),
        ("rusty_wall", {"seam_pitch_m": 0.003}, "seam_pitch_m"),
        ("pipe", {"wall_m": 0.05}, "wall_m"),
        ("pipe", {"flange_m": 0.01, "flange_length_m": 0.3}, "flange_length_m"),
        ("rope", {"diameter_m": 0.1}, "diameter_m"),
        ("rope", {"sag_m": 0.5}, "sag_m"),
        ("siemens_star", {"diameter_m": 0.4}, "diameter_m"),
        ("siemens_star", {"cycles": 2}, "cycles"),
        ("slanted_edge", {"angle_deg": 44.0, "height_m": 0.3}, "angle_deg"),
        ("charuco_board", {"marker_m": 0.05}, "marker_m"),
        ("charuco_board", {"dictionary": "DICT_9X9"}, "dictionary"),
        ("charuco_board", {"first_id": 90}, "markers, needed"),
        ("marker_layout", {"seed": None}, "seed"),
        ("marker_layout", {"layout": "planar_4"}, "seed"),
        ("marker_layout", {"layout": "planar_4", "seed": None, "sphere_radius_m": 0.06}, "sphere_radius_m"),
        ("marker_layout", {"rod_m": 0.02}, "rod_m"),
        ("marker_layout", {"box_m": (0.01, 0.01, 0.01)}, "box_m"),
        ("marker_layout", {"colour": "red"}, "colour"),
    ],
)
def test_impossible_bodies_are_refused(kind, changes, message):
    with pytest.raises(ValueError, match=message):
        body(kind, **changes)


def test_a_part_refuses_shares_that_do_not_fit():
    grey, faces = np.full(61, 0.5), np.array([[0, 1, 2]])
    with pytest.raises(ValueError, match="tones"):
        surface.Part(np.zeros((3, 3)), faces, (grey, grey))
    with pytest.raises(ValueError, match="shares"):
        surface.Part(np.zeros((3, 3)), faces, (grey, grey), vertex_share=np.array([0, 0.5, 1.1]))


# ---- materials, noise, truth ----


def test_materials_are_reflectances_and_what_they_are_called():
    for name in surfaces.material_names():
        reflectance = surfaces.material_reflectance(name)
        assert reflectance.shape == WAVELENGTHS_NM.shape and 0 < reflectance.min() <= reflectance.max() < 1
    curves = {name: surfaces.material_reflectance(name) for name in surfaces.material_names()}
    at = {name: dict(zip(WAVELENGTHS_NM.tolist(), curve, strict=True)) for name, curve in curves.items()}
    assert at["rust"][650.0] > 3 * at["rust"][450.0]
    assert at["leaf_green"][550.0] > 2 * max(at["leaf_green"][450.0], at["leaf_green"][670.0])
    assert at["basalt"][550.0] == pytest.approx(0.25311)  # as printed
    with pytest.raises(ValueError, match="allowed: basalt, marble"):
        surfaces.material_reflectance("gold")


def test_noise_is_smooth_bounded_and_without_mean():
    points = np.random.default_rng(0).uniform(-30, 30, (20000, 3))
    here, near = (noise.gradient_noise(points + offset, rng=np.random.default_rng(1)) for offset in (0, 1e-4))
    assert np.abs(here).max() <= 1
    assert abs(here.mean()) < 4 * here.std() / np.sqrt(3000)  # cells are shared
    assert np.abs(here - near).max() < 1e-3
    assert noise.gradient_noise(np.zeros((1, 3)), rng=np.random.default_rng(1)) == pytest.approx(0)
    with pytest.raises(ValueError, match="octaves"):
        noise.fractal_noise(points, octaves=0, rng=np.random.default_rng(0))


def test_the_shipped_scene_has_the_points_and_markers_of_its_targets():
    scene = load_scene("tank_assets")
    buffer = np.full((scene.rig.camera.height_px, scene.rig.camera.width_px), np.inf)
    points = truth.marker_points(scene, range_m=buffer)
    for found in scene.bodies:
        own = [point for point in points if point["body"] == found.name]
        if isinstance(found, MarkerLayout):
            assert [point["point_body_m"] for point in own] == found.points_m.tolist()
            assert {point["radius_m"] for point in own} == {found.sphere_radius_m}
        elif isinstance(found, CharucoBoard):
            assert len(own) == (found.columns - 1) * (found.rows - 1)
            entries = truth.marker_corners(scene, range_m=buffer)
            assert [entry["id"] for entry in entries if entry["body"] == found.name] == list(found.ids)
        else:
            assert not own
    hidden = truth.marker_points(scene, range_m=np.full_like(buffer, 0.1))
    assert not any(point["visible"] for point in hidden)
