"""Scenes in which something stands where it cannot, moves as it cannot, or does not fit into memory."""

from pathlib import Path

from tests.system.broken import GENERATE, PLAIN, RENDER, SCENE, Case, changed, put

WALL = SCENE[SCENE.index('name = "wall"') :]
CAMERA, LAMP = (0.0, 0.0, -0.6), (0.0, 0.0, -0.45)  # where they are in the world
STILL = "position_m = [0.0, 0.0, -0.6]\nlook_at_m = [0.0, 1.0, -0.6]"
HOUSING = "housing = {{ radius_m = {}, length_m = {} }}\n"
DAY = "[daylight]\nsun_irradiance_w_per_m2 = 500.0\nsky_irradiance_w_per_m2 = 100.0\nsun_zenith_deg = 30.0\n"
SNOW = 'name = "snow"\nkind = "marine_snow"\nreflectance = 0.5\nseed = 1\n'
BOX = "low_m = [-1, 0, -1]\nhigh_m = [1, 1, -0.2]\n"
_CUBE = """ply
format ascii 1.0
element vertex 8
property float x
property float y
property float z
element face 12
property list uchar int vertex_indices
end_header
-1 -1 -1
1 -1 -1
1 1 -1
-1 1 -1
-1 -1 1
1 -1 1
1 1 1
-1 1 1
"""
_OUTWARD = ((0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7),
            (2, 7, 6), (3, 0, 4), (3, 4, 7))  # fmt: skip


def cube(*, outward: bool = True) -> str:
    """A closed cube with sides of 2 as a PLY file."""
    faces = _OUTWARD if outward else [face[::-1] for face in _OUTWARD]
    return _CUBE + "".join(f"3 {a} {b} {c}\n" for a, b, c in faces)


def mesh(position_m, *, half_m: float = 0.05, more: str = "") -> str:
    """A cube of half that side in place of the wall."""
    return (
        f'name = "wall"\nkind = "mesh"\nfile = "cube.ply"\nscale = {half_m}\nreflectance = 0.1\n'
        f"position_m = {list(position_m)}\n{more}"
    )


def moving(x_m_per_s: float) -> str:
    return f"motion = {{ velocity_m_per_s = [{x_m_per_s}, 0, 0] }}\n"


def flat(position_m) -> str:
    """The wall, lying horizontally, elsewhere."""
    return f'name = "wall"\n{PLAIN}\nposition_m = {list(position_m)}\n'


def text(*changes: tuple[str, str]) -> str:
    result = SCENE
    for old, new in changes:
        result = changed(result, old, new)
    return result


def placed(name: str, changes: list[tuple[str, str]], *fragments: str, arguments=RENDER) -> Case:
    def prepare(folder: Path) -> None:
        put(folder, "scene.toml", text(*changes))
        put(folder, "cube.ply", cube())

    return Case(f"placement {name}", arguments, fragments, prepare)


def in_lamp(new: str) -> tuple[str, str]:
    return 'spectrum = "LED-B3"\n', 'spectrum = "LED-B3"\n' + new


def in_camera(new: str) -> tuple[str, str]:
    return 'response = "Nikon 5100 (NPL)"\n', 'response = "Nikon 5100 (NPL)"\n' + new


PLACEMENTS = [
    placed("camera inside", [(WALL, mesh(CAMERA))], "camera: is inside body wall"),
    placed("camera inside, geometry", [(WALL, mesh(CAMERA))], "camera: is inside body wall",
           arguments=(*RENDER, "--geometry-only")),
    placed("camera inside, dataset", [(WALL, mesh(CAMERA))], "camera: is inside body wall", arguments=GENERATE),
    placed("port inside", [(WALL, mesh((0, 0.2, -0.6))),
           in_camera('port = { kind = "flat", gap_m = 0.19, thickness_m = 0.01 }\n')], "camera: is inside body wall"),
    placed("camera inside at the end", [(WALL, mesh((0.3, 0, -0.6), more=moving(-150)))],
           "camera: is inside body wall", "whole exposure"),
    placed("lamp inside", [(WALL, mesh(LAMP))], "lamp led: is inside body wall"),
    placed("camera in a surface", [(WALL, flat((0, 0, -0.6002)))], "camera: is 0.0002 m from", "body wall", "0.001 m"),
    placed("lamp in a surface", [(WALL, flat(LAMP))], "lamp led: is", "body wall", "0.001 m"),
    placed("camera in the side of a cube", [(WALL, mesh((0.0505, 0, -0.6)))], "camera: is 0.0005 m from", "body wall"),
    placed("lamp in the camera's housing", [in_camera(HOUSING.format(0.3, 0.2)),
           ("position_m = [0.0, -0.15, 0.0]", "position_m = [0.0, -0.15, -0.1]")],
           "lamp led: is inside the housing of camera"),
    placed("camera in the lamp's housing", [in_lamp(HOUSING.format(0.3, 0.2)),
           ("position_m = [0.0, -0.15, 0.0]", "position_m = [0.0, -0.15, 0.1]"),
           ("look_at_m = [0.0, 0.0, 1.0]", "look_at_m = [0.0, -0.15, 1.0]")],
           "camera: is inside the housing of lamp led"),
    placed("housings in each other", [in_camera(HOUSING.format(0.1, 0.2)), in_lamp(HOUSING.format(0.07, 0.2))],
           "lamp led: its housing stands in that of the camera"),
    placed("body in the air", [(WALL, flat((0, 1, 0.5))), ("[exposure]", DAY + "[exposure]")], "body wall", "z = 0.5",
           "below the water surface"),
    placed("body moves into the air", [(WALL, mesh((0, 1.5, -0.1), more="motion = { velocity_m_per_s = [0, 0, 50] }")),
           ("[exposure]", DAY + "[exposure]")], "body wall", "z = 0.05", "below the water surface"),
    placed("snow in the air", [(WALL, SNOW + "count = 9\ndiameters_m = [0.001, 0.002]\nlow_m = [0, 0, -1]\n"
           "high_m = [1, 1, 0.1]\n"), ("[exposure]", DAY + "[exposure]")], "body snow", "z = 0.1"),
    placed("memory", [("width_px = 32\nheight_px = 24", "width_px = 16384\nheight_px = 16384")], "16384 x 16384",
           "GB of memory", "available"),
]  # fmt: skip

MOTIONS = [
    placed("unsorted trajectory", [(STILL, "[rig.trajectory]\ntimes_s = [-0.1, 0.1, 0.05]\n"
           "positions_m = [[0, 0, -0.6], [0, 0, -0.6], [0, 0, -0.6]]\n"
           "look_at_m = [[0, 1, -0.6], [0, 1, -0.6], [0, 1, -0.6]]")], "scene.toml: rig.trajectory",
           "0.1 s before 0.05 s", "strictly increasing"),
    placed("unsorted trajectory of a body", [(WALL, WALL.replace("position_m = [0.0, 1.5, -0.75]\n", "")
           + "[bodies.trajectory]\ntimes_s = [0.1, -0.1]\npositions_m = [[0, 1, -1], [0, 1, -1]]\n"
           "look_at_m = [[0, 0, -1], [0, 0, -1]]\n")], "bodies.1.trajectory", "0.1 s before -0.1 s"),
    placed("short trajectory of a body", [(WALL, WALL.replace("position_m = [0.0, 1.5, -0.75]\n", "")
           + "[bodies.trajectory]\ntimes_s = [0, 0.1]\npositions_m = [[0, 1, -1], [0, 1, -1]]\n"
           "look_at_m = [[0, 0, -1], [0, 0, -1]]\n")], "body wall: trajectory", "do not cover the exposure"),
    placed("body with two ways", [(WALL, WALL + "[bodies.trajectory]\ntimes_s = [-0.1, 0.1]\n"
           "positions_m = [[0, 1, -1], [0, 1, -1]]\nlook_at_m = [[0, 0, -1], [0, 0, -1]]\n")], "bodies.1",
           "a trajectory and position_m", "one way"),
    placed("body nowhere", [("position_m = [0.0, 1.5, -0.75]\n", "")], "bodies.1", "position_m: missing"),
    placed("body and rolling shutter", [(WALL, WALL + "motion = { velocity_m_per_s = [1, 0, 0] }\n"),
           ("time_s = 0.004", "time_s = 0.004\nreadout_s = 0.01")], "wall moves", "readout_s is 0.01 s", "global"),
    placed("body too fast", [(WALL, mesh((0, 0.3, -0.6), half_m=0.01, more=moving(9000)))],
           "body wall", "px through the image", "512 px"),
    placed("snow counts", [(WALL, SNOW + BOX + "count = 9\nnumber_per_m3 = 3.0\ndiameters_m = [0.001, 0.002]\n")],
           "bodies.1", "either count or number_per_m3"),
    placed("snow too many", [(WALL, SNOW + BOX + "number_per_m3 = 3e6\ndiameters_m = [0.001, 0.002]\n")], "bodies.1",
           "4800000 particles", "200000"),
    placed("snow diameters", [(WALL, SNOW + BOX + "count = 9\ndiameters_m = [0.003, 0.002]\n")], "bodies.1",
           "the smallest first"),
    placed("snow box", [(WALL, SNOW + BOX.replace("-0.2", "-1") + "count = 9\ndiameters_m = [0.1, 0.2]\n")],
           "bodies.1", "low_m below high_m"),
    placed("snow on the lens", [(WALL, SNOW + BOX + "count = 9\ndiameters_m = [0.001, 0.002]\nclear_m = 0.0\n")],
           "bodies.1.clear_m", "> 0"),
]  # fmt: skip
