"""Bodies in motion: the exposure in equal parts, in each of which they stand where they are in its middle.

The rig goes on moving within a part, on the table of its poses. The mean over all parts, in linear radiance, is the
picture; each batch of samples runs through all of them.
"""

import numpy as np

from uwsim.camera import pose


class SubFrames:
    """The shapes of a loaded scene that move, and where they are in each of `count` parts of the exposure.

    scene: loaded with `optimize=False`, its bodies as they are at mid-exposure.
    moves: by shape id, `then_from_middle` (count, 4, 4): how it moves in the world from mid-exposure to each part.
    Moving a body compiles nothing anew.
    """

    def __init__(self, scene, moves: dict[str, np.ndarray]):
        import mitsuba as mi

        self.count = len(next(iter(moves.values())))
        self._parameters = mi.traverse(scene)
        self._shapes = [_Shape(self._parameters, shape_id, then) for shape_id, then in moves.items()]

    def show(self, part: int) -> None:
        """Put all bodies where they are in the middle of a part, from 0."""
        for write in (_Shape.put, _Shape.put_normals):
            for shape in self._shapes:
                write(shape, self._parameters, part)
            self._parameters.update()


class _Shape:
    """A rectangle by its transform, or a mesh by its vertices."""

    def __init__(self, parameters, shape_id: str, then_from_middle: np.ndarray):
        self.key, self.then = shape_id, then_from_middle
        self.to_world, self.vertices, self.normals = None, None, None
        if f"{shape_id}.to_world" in parameters:
            matrix = np.array(parameters[f"{shape_id}.to_world"].matrix, float)
            self.to_world = matrix.reshape(4, 4)
            return
        self.vertices = np.array(parameters[f"{shape_id}.vertex_positions"], float).reshape(-1, 3)
        normals = np.array(parameters[f"{shape_id}.vertex_normals"], float).reshape(-1, 3)
        self.normals = normals if len(normals) else None

    def put(self, parameters, part: int) -> None:
        if self.to_world is not None:
            parameters[f"{self.key}.to_world"] = _transform(self.then[part] @ self.to_world)
        else:
            parameters[f"{self.key}.vertex_positions"] = _flat(pose.apply(self.then[part], self.vertices))

    def put_normals(self, parameters, part: int) -> None:
        """Turn a file's own normals with the vertices: new vertices alone would make Mitsuba choose its own."""
        if self.normals is not None:
            parameters[f"{self.key}.vertex_normals"] = _flat(self.normals @ self.then[part][:3, :3].T)


def _transform(matrix: np.ndarray):
    import drjit as dr
    import mitsuba as mi

    rows = [[dr.opaque(mi.Float, float(value)) for value in row] for row in matrix]
    return mi.Transform4f(mi.Matrix4f(rows))


def _flat(values: np.ndarray):
    import mitsuba as mi

    return mi.Float(np.ascontiguousarray(values, dtype=np.float32).ravel())
