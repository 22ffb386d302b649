"""Bodies whose surface is computed: triangles with two tones, and the pieces that they are put together from.

Faces are counter-clockwise seen from outside.
"""

import functools
import itertools
from dataclasses import dataclass, field

import numpy as np

from uwsim.scene.placed import Placed, Reflectance, reflectance_on_grid

MOST_VERTICES = 1_000_000
_AT_REST = {"name": "_", "position_m": (0.0, 0.0, 0.0), "towards_m": None, "rotation_deg": (0.0, 0.0, 0.0),
            "motion": None, "trajectory": None}  # fmt: skip


@dataclass(frozen=True)
class Part:
    """Triangles of a body in its own frame: `vertices` (v, 3) [m] and `faces` (f, 3).

    `tones`: the reflectance (61,) of all of it; or two, mixed by the share of the second, 0 to 1, at each vertex (v,)
    or on each face (f,).
    """

    vertices: np.ndarray
    faces: np.ndarray
    tones: tuple[np.ndarray, ...]
    vertex_share: np.ndarray | None = field(default=None)
    face_share: np.ndarray | None = field(default=None)

    def __post_init__(self):
        shares = [share for share in (self.vertex_share, self.face_share) if share is not None]
        if len(self.tones) != 1 + len(shares):
            raise ValueError(f"part: {len(self.tones)} tones and {len(shares)} shares, allowed: 1 and 0, or 2 and 1")
        for share, owners in ((self.vertex_share, self.vertices), (self.face_share, self.faces)):
            if share is not None and (len(share) != len(owners) or not np.all((share >= 0) & (share <= 1))):
                raise ValueError(f"part: got {len(share)} shares for {len(owners)}, allowed: as many, from 0 to 1")


class Generated(Placed):
    """A body whose surface is computed from its description; `dark` and `bright` are its tones."""

    @property
    def parts(self) -> dict[str, Part]:
        """The body's surface by the name of its parts. The same description gives the same numbers."""
        return _parts(self.model_copy(update=_AT_REST))

    def make_parts(self) -> dict[str, Part]:
        raise NotImplementedError

    def tone(self, key: str) -> np.ndarray:
        """Return the reflectance (61,) of one of the fields."""
        return reflectance_on_grid(getattr(self, key), where=f"body {self.name}: {key}")

    @property
    def triangles(self) -> np.ndarray:
        """All of the surface (n, 3, 3) in the body's frame. [m]"""
        return np.concatenate([part.vertices[part.faces] for part in self.parts.values()])


class TwoTone(Generated):
    """A computed body of two tones."""

    dark: Reflectance
    bright: Reflectance

    @property
    def tones(self) -> tuple[np.ndarray, np.ndarray]:
        return self.tone("dark"), self.tone("bright")


@functools.lru_cache(maxsize=32)
def _parts(body: Generated) -> dict[str, Part]:
    parts = body.make_parts()
    for part in parts.values():
        for array in (part.vertices, part.faces, part.vertex_share, part.face_share):
            if array is not None:
                array.setflags(write=False)
    return parts


def generator(seed: int, purpose: str) -> np.random.Generator:
    """Return random numbers that depend on the seed and on what they are for."""
    return np.random.default_rng([seed, *purpose.encode()])


def check_vertices(count: int, *, where: str) -> None:
    """Raise ValueError if a surface would have too many vertices."""
    if count > MOST_VERTICES:
        raise ValueError(f"{where}: makes {count} vertices, allowed: {MOST_VERTICES}")


def merged(pieces: list[tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
    """Return pieces (vertices, faces, anything per vertex ...) as one."""
    first = np.cumsum([0] + [len(piece[0]) for piece in pieces[:-1]])
    faces = np.concatenate([piece[1] + offset for piece, offset in zip(pieces, first, strict=True)])
    others = [np.concatenate(column) for column in list(zip(*pieces, strict=True))[2:]]
    return (np.concatenate([piece[0] for piece in pieces]), faces, *others)


def grid_faces(rows: int, columns: int, *, around: bool = False) -> np.ndarray:
    """Return faces of a grid of vertices, (rows, columns) in reading order, that face the reader.

    `around`: the last column is joined to the first.
    """
    corner = np.arange(rows * columns).reshape(rows, columns)
    if around:
        corner = np.concatenate([corner, corner[:, :1]], axis=1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    return np.concatenate([np.stack([a, c, b], axis=-1), np.stack([b, c, d], axis=-1)])


@functools.cache
def icosphere(level: int) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vertices (10 4^level + 2, 3) and outward faces (20 4^level, 3) of a subdivided icosahedron."""
    golden = (1 + np.sqrt(5)) / 2
    vertices = np.array([[s, t * golden, 0] for s in (-1, 1) for t in (-1, 1)])
    vertices = np.concatenate([np.roll(vertices, shift, axis=1) for shift in range(3)])
    vertices /= np.linalg.norm(vertices[0])
    # three corners make a face where they are as near to each other as neighbours are
    near = np.isclose(vertices @ vertices.T, 1 / np.sqrt(5))
    trios = itertools.combinations(range(12), 3)
    faces = np.array([trio for trio in trios if all(near[pair] for pair in itertools.combinations(trio, 2))])
    normal = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    inward = np.einsum("ni,ni->n", normal, vertices[faces[:, 0]]) < 0
    faces[inward] = faces[inward][:, ::-1]
    for _ in range(level):
        vertices, faces = _split(vertices, faces)
    return vertices, faces


def _split(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return every face of a sphere as four."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, index = np.unique(edges, axis=0, return_inverse=True)
    middles = vertices[unique].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=-1, keepdims=True)
    ab, bc, ca = (index.ravel() + len(vertices)).reshape(3, -1)
    a, b, c = faces.T
    corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([vertices, middles]), np.concatenate([np.stack(corner, axis=-1) for corner in corners])


def revolved(profile: np.ndarray, *, sides: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the surface that a closed profile (n, 2) of radius > 0 and height makes about the z axis.

    The profile runs counter-clockwise with the radius to the right and the height up; it is closed by itself.
    """
    angle = np.arange(sides) * 2 * np.pi / sides
    rows = np.concatenate([profile, profile[:1]])
    radius, height = rows[:, :1], np.broadcast_to(rows[:, 1:], (len(rows), sides))
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)[:-1].reshape(-1, 3)
    return vertices, grid_faces(len(rows), sides, around=True)[:, ::-1] % len(vertices)


def tube(rings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rings (rows, sides, 3) of points as a closed tube; each ring turns right-handed about the way along."""
    rows, sides = rings.shape[:2]
    ends = rings[[0, -1]].mean(axis=1)
    first, last = rows * sides, rows * sides + 1
    ring, on = np.arange(sides), (np.arange(sides) + 1) % sides
    start = np.stack([np.full(sides, first), on, ring], axis=-1)
    end = np.stack([np.full(sides, last), ring, on], axis=-1) + np.array([0, 1, 1]) * (rows - 1) * sides
    sides_of_it = grid_faces(rows, sides, around=True)[:, ::-1]
    return np.concatenate([rings.reshape(-1, 3), ends]), np.concatenate([sides_of_it, start, end])


def scattered(
    radii_m: np.ndarray, *, field_m: tuple[float, float], rng: np.random.Generator, where: str
) -> np.ndarray:  # fmt: skip
    """Return places (n, 2) in a field about the origin of discs that do not overlap, the largest placed first.

    Raises ValueError if they do not fit.
    """
    places = np.zeros((len(radii_m), 2))
    half, done = np.array(field_m) / 2, []
    for index in np.argsort(-radii_m, kind="stable"):
        for tried in rng.uniform(-half, half, (500, 2)):
            apart = np.linalg.norm(places[done] - tried, axis=-1)
            if np.all(apart >= radii_m[done] + radii_m[index]):
                places[index] = tried
                done.append(index)
                break
        else:
            raise ValueError(f"{where}: {len(radii_m)} bodies do not fit beside each other into {field_m[0]:g} x "
                             f"{field_m[1]:g} m, allowed: fewer or smaller ones, or a larger field_m")  # fmt: skip
    return places
