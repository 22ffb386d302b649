"""Bodies as Mitsuba shapes."""

import numpy as np

from uwsim.camera import pose
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.scene import bodies as kinds
from uwsim.scene import markers
from uwsim.scene.snow import CORNER_PER_RADIUS, octahedra

# How far the patches of a ColorChecker stand out of its frame, and markers out of their board.
_RELIEF_M = 1e-4
_FOLLOWED = 400  # points of a mesh, and of particles, that are followed through the image
_GRID = 17  # of points on a flat body, along each side


def spectrum(values: np.ndarray, *, where: str = "spectrum") -> dict:
    """Return a Mitsuba spectrum that interpolates values (61,) on the project's grid."""
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{where}: not finite")
    if not np.any(values):
        return {"type": "uniform", "value": 0.0}  # Mitsuba refuses a table of zeros
    text = ",".join(f"{value:.9g}" for value in values)
    low, high = float(WAVELENGTHS_NM[0]), float(WAVELENGTHS_NM[-1])
    return {"type": "regular", "wavelength_min": low, "wavelength_max": high, "values": text}


def tensor(mi, values: np.ndarray):
    """Return an array (n,) or (n, m) as a tensor (1, n, m), the form in which Mitsuba hands arrays to plugins."""
    values = np.asarray(values, dtype=np.float32)
    # a leading axis of 3 would first be taken for a colour, with a complaint on standard error
    return mi.TensorXf(values.reshape(1, len(values), -1))


def body_shapes(mi, body) -> dict[str, object]:
    """Return the Mitsuba shapes of one body by the name of its part."""
    matrix = body.world_from_body
    match body:
        case kinds.Rectangle():
            return {"face": _rectangle(mi, matrix, body.width_m, body.height_m, _diffuse(body.spectrum))}
        case kinds.MarkerBoard():
            return _marker_board(mi, body)
        case kinds.Chart():
            bsdf = _two_tones(mi, body.coverage, body.spectra, smooth=body.smooth)
            return {"face": _rectangle(mi, matrix, body.width_m, body.height_m, bsdf)}
        case kinds.ColorChecker():
            return _colorchecker(mi, body)
        case kinds.Heightfield():
            return {"face": _relief(mi, body, _both_sides(_diffuse(body.spectrum)))}
        case kinds.Mesh():
            return {"face": _mesh(mi, body, _both_sides(_diffuse(body.spectrum)))}
        case kinds.Generated():
            return {name: _part(mi, f"{body.name}_{name}", matrix, part) for name, part in body.parts.items()}
    raise TypeError(f"no shape for a body of type {type(body).__name__}")


def snow_shape(mi, snow: kinds.MarineSnow, *, openings_m: np.ndarray):
    """Return the particles as one mesh, without those too near to `openings_m` (..., 3) in the cloud's frame.

    None if none is left.
    """
    middles, radii, turns = snow.particles()
    reach_m = CORNER_PER_RADIUS * radii + snow.clear_m
    near = np.zeros(len(middles), bool)
    for opening_m in np.reshape(openings_m, (-1, 3)):
        near |= np.linalg.norm(middles - opening_m, axis=-1) < reach_m
    if near.all():
        return None
    vertices, faces = octahedra(middles[~near], radii[~near], turns[~near])
    vertices = pose.apply(snow.world_from_body, vertices)
    return _triangles(mi, snow.name, vertices, faces, _both_sides(_diffuse(snow.spectrum)))


def body_triangles(mi, body) -> np.ndarray:
    """Return what a body consists of, as triangles (n, 3, 3) in world coordinates at mid-exposure; charts are flat."""
    match body:
        case kinds.Mesh():
            parameters = mi.traverse(body_shapes(mi, body)["face"])
            vertices, faces = np.array(parameters["vertex_positions"]), np.array(parameters["faces"])
            return vertices.reshape(-1, 3).astype(float)[faces.reshape(-1, 3)]
        case kinds.Heightfield():
            vertices, faces = _relief_triangles(body)
            return vertices[faces]
        case kinds.Generated():
            return pose.apply(body.world_from_body, body.triangles)
    half = np.array([body.width_m, body.height_m, 0.0]) / 2
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half
    return pose.apply(body.world_from_body, corners)[[[0, 1, 2], [0, 2, 3]]]


def body_points(body, *, near_m: np.ndarray) -> np.ndarray:
    """Return points (n, 3) of a body in its own frame that stand for all of it where it is followed through the image.

    Of particles the nearest to `near_m` (3,) in the world, and some of the others.
    """
    import mitsuba as mi

    if isinstance(body, kinds.MarineSnow):
        points = body.particles()[0]
        apart_m = np.linalg.norm(points - pose.apply(pose.inverse(body.world_from_body), near_m), axis=-1)
        points = points[np.argsort(apart_m, kind="stable")]
        return np.concatenate([points[:_FOLLOWED], points[_FOLLOWED :: max(1, len(points) // _FOLLOWED)]])
    if isinstance(body, (kinds.Mesh, kinds.Heightfield, kinds.Generated)):
        corners = np.unique(body_triangles(mi, body).reshape(-1, 3), axis=0)
        corners = corners[:: max(1, len(corners) // _FOLLOWED)]
        return pose.apply(pose.inverse(body.world_from_body), corners)
    x, y = np.meshgrid(*(np.linspace(-0.5, 0.5, _GRID) * size for size in (body.width_m, body.height_m)))
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)


def _diffuse(reflectance: np.ndarray) -> dict:
    return {"type": "diffuse", "reflectance": spectrum(reflectance)}


def _both_sides(bsdf: dict) -> dict:
    return {"type": "twosided", "bsdf": bsdf}


def _two_tones(mi, coverage: np.ndarray, tones, *, smooth: bool) -> dict:
    """Return a BSDF that mixes the dark and the bright tone by `coverage` (rows, columns), row 0 on top."""
    dark, bright = tones
    weight = {
        "type": "bitmap",
        # Mitsuba puts row 0 at the bottom of a rectangle
        "bitmap": mi.Bitmap(np.ascontiguousarray(coverage[::-1], dtype=np.float32)[..., None]),
        "raw": True,
        "filter_type": "bilinear" if smooth else "nearest",
        "wrap_mode": "clamp",
    }
    return {"type": "blendbsdf", "weight": weight, "first": _diffuse(dark), "second": _diffuse(bright)}


def _rectangle(mi, matrix: np.ndarray, width_m: float, height_m: float, bsdf: dict) -> dict:
    to_world = matrix @ np.diag([width_m / 2, height_m / 2, 1.0, 1.0])
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f(to_world), "bsdf": _both_sides(bsdf)}


def _at(matrix: np.ndarray, x_m: float, y_m: float, z_m: float) -> np.ndarray:
    offset = np.eye(4)
    offset[:3, 3] = x_m, y_m, z_m
    return matrix @ offset


def _marker_board(mi, body: kinds.MarkerBoard) -> dict:
    """Return markers in the body's plane, one texel per module, on a bright board just behind them."""
    matrix, size = body.world_from_body, body.marker_size_m
    board = _rectangle(mi, _at(matrix, 0, 0, -_RELIEF_M), body.width_m, body.height_m, _diffuse(body.spectra[1]))
    shapes = {"board": board}
    for marker_id, corners in zip(body.ids, body.corners_m, strict=True):
        modules = markers.modules(body.dictionary, marker_id)
        bsdf = _two_tones(mi, modules, body.spectra, smooth=False)
        shapes[f"marker{marker_id}"] = _rectangle(mi, _at(matrix, *corners.mean(axis=0)), size, size, bsdf)
    return shapes


def _colorchecker(mi, body: kinds.ColorChecker) -> dict:
    matrix, side = body.world_from_body, body.pitch_m * (1 - body.gap_share)
    frame = np.full(len(WAVELENGTHS_NM), body.frame_reflectance)
    shapes = {"frame": _rectangle(mi, matrix, body.width_m, body.height_m, _diffuse(frame))}
    for index, (_, (x, y), reflectance) in enumerate(body.patches):
        place = _at(matrix, x, y, _RELIEF_M)
        shapes[f"patch{index}"] = _rectangle(mi, place, side, side, _diffuse(reflectance))
    return shapes


def _mesh(mi, body: kinds.Mesh, bsdf: dict):
    """Return a mesh read from its file; ValueError if it cannot be read or is no surface."""
    shape = {
        "type": body.file.suffix.lower().removeprefix("."),
        "filename": str(body.file),
        "to_world": mi.ScalarTransform4f(body.world_from_body @ np.diag([body.scale] * 3 + [1.0])),
        "bsdf": bsdf,
    }
    where = f"body {body.name}: file {body.file}"
    try:
        mesh = mi.load_dict(shape)
    except RuntimeError as error:
        reason = " ".join(str(error).split()).rpartition("shape plugin of type ")[2]
        raise ValueError(f"{where}: not a mesh that can be read: {reason}") from None
    parameters = mi.traverse(mesh)
    vertices, faces = np.array(parameters["vertex_positions"]), np.array(parameters["faces"])
    if not np.all(np.isfinite(vertices)):
        raise ValueError(f"{where}: has non-finite vertices")
    if faces.size == 0 or faces.max() >= mesh.vertex_count():
        raise ValueError(
            f"{where}: {faces.size // 3} faces of {mesh.vertex_count()} vertices, allowed: faces of its vertices"
        )
    return mesh


def check_files(scene) -> None:
    """Raise ValueError unless every file of a scene's bodies that only the renderer reads can be read."""
    import mitsuba as mi

    for body in scene.bodies:
        if isinstance(body, kinds.Mesh):
            body_shapes(mi, body)


def _relief(mi, body: kinds.Heightfield, bsdf: dict):
    """Return a heightfield as a triangle mesh in world coordinates."""
    return _triangles(mi, body.name, *_relief_triangles(body), bsdf)


def _relief_triangles(body: kinds.Heightfield) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) in world coordinates and faces (f, 3)."""
    heights = body.heights_m
    rows, columns = heights.shape
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns) * body.width_m, np.linspace(0.5, -0.5, rows) * body.height_m)
    local = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
    vertices = local @ body.world_from_body[:3, :3].T + body.world_from_body[:3, 3]
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    return vertices, np.concatenate([np.stack([a, c, b], axis=-1), np.stack([b, c, d], axis=-1)])


def _part(mi, name: str, matrix: np.ndarray, part):
    """Return a computed part of a body as a mesh whose tones are mixed at its vertices or on its faces."""
    vertices = pose.apply(matrix, part.vertices)
    if len(part.tones) == 1:
        return _triangles(mi, name, vertices, part.faces, _both_sides(_diffuse(part.tones[0])))
    attribute = "vertex_share" if part.vertex_share is not None else "face_share"
    first, second = (_diffuse(tone) for tone in part.tones)
    weight = {"type": "mesh_attribute", "name": attribute}
    bsdf = {"type": "blendbsdf", "weight": weight, "first": first, "second": second}
    mesh = _triangles(mi, name, vertices, part.faces, _both_sides(bsdf))
    share = part.vertex_share if part.vertex_share is not None else part.face_share
    mesh.add_attribute(attribute, 1, np.ascontiguousarray(share, dtype=np.float32))
    return mesh


def _triangles(mi, name: str, vertices: np.ndarray, faces: np.ndarray, bsdf: dict):
    """Return a mesh without vertex normals."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    mesh = mi.Mesh(name, vertex_count=len(vertices), face_count=len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(vertices, dtype=np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    parameters.update()
    return mesh
