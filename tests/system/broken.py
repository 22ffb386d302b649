"""Input that is accepted, and ways to break one thing of it: the material of test_broken_inputs.py."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

SCENE = """
name = "broken"
description = "accepted as it stands"
[water]
wavelengths_nm = [400, 550, 700]
absorption_per_m = [0.1, 0.1, 0.6]
scattering_per_m = [0.2, 0.2, 0.2]
phase = { type = "hg_mixture", g = [0.9, -0.4], weights = [0.98, 0.02] }
[rig]
position_m = [0.0, 0.0, -0.6]
look_at_m = [0.0, 1.0, -0.6]
[rig.camera]
width_px = 32
height_px = 24
horizontal_fov_deg = 50.0
response = "Nikon 5100 (NPL)"
[[rig.lamps]]
name = "led"
position_m = [0.0, -0.15, 0.0]
look_at_m = [0.0, 0.0, 1.0]
radiant_flux_w = 10.0
half_angle_deg = 35.0
spectrum = "LED-B3"
[exposure]
time_s = 0.004
[[bodies]]
name = "chart"
kind = "usaf_1951"
width_m = 0.72
first_group = -5
last_group = -2
position_m = [0.0, 1.0, -0.6]
towards_m = [0.0, 0.0, -0.6]
[[bodies]]
name = "wall"
kind = "rectangle"
width_m = 3.0
height_m = 1.5
reflectance = 0.1
position_m = [0.0, 1.5, -0.75]
"""
BOARD = 'kind = "marker_board"\nmarker_size_m = 0.1\ngap_m = 0.02\ncolumns = 2\nrows = 2'
PLAIN = 'kind = "rectangle"\nwidth_m = 3.0\nheight_m = 1.5\nreflectance = 0.1'
RECTANGLE = 'kind = "rectangle"\nwidth_m = 3.0\nheight_m = 1.5'
LAMPS = SCENE[SCENE.index("[[rig.lamps]]") : SCENE.index("[exposure]")]
BODIES = SCENE[SCENE.index("[[bodies]]") :]
RECIPE = """
name = "broken"
description = "accepted as it stands"
seed = 1
samples_per_pixel = 8
batches = 4
[[group]]
name = "one"
scene = "scene.toml"
frames = 2
[group.draw]
"rig.lamps.led.half_angle_deg" = { distribution = "uniform", low = 20.0, high = 40.0 }
"""
DRAWN = '"rig.lamps.led.half_angle_deg" = { distribution = "uniform", low = 20.0, high = 40.0 }'
WRONG_PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 7
"""
RENDER = ("render", "scene.toml", "--out", "out")
GENERATE = ("generate", "recipe.toml", "--out", "out")
RESTORATION = ("bench", "restoration", "--dataset", "data")
Prepare = Callable[[Path], object]


@dataclass(frozen=True)
class Case:
    """`prepare` breaks the folder it is given; the line must hold every one of `fragments`."""

    name: str
    arguments: tuple[str, ...]
    fragments: tuple[str, ...]
    prepare: Prepare = lambda folder: None
    needs_data: bool = False


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the text to break"
    return text.replace(old, new)


def scene(name: str, old: str, new: str, *fragments: str) -> Case:
    """A scene with one passage replaced, to be rendered."""
    text = changed(SCENE, old, new)
    return Case(f"scene {name}", RENDER, ("scene.toml", *fragments), lambda folder: put(folder, "scene.toml", text))


def mesh(name: str, arguments: tuple[str, ...], file: str, *fragments: str) -> Case:
    """A scene with a mesh file that only the renderer can find to be broken."""
    text = changed(SCENE, RECTANGLE, f'kind = "mesh"\nfile = "{file}"')
    fragments = ("body wall", file, *fragments)
    return Case(f"mesh {name}", arguments, fragments, lambda folder: put(folder, "scene.toml", text))


def recipe(name: str, old: str, new: str, *fragments: str) -> Case:
    text = changed(RECIPE, old, new)
    return Case(
        f"recipe {name}", GENERATE, ("recipe.toml", *fragments), lambda folder: put(folder, "recipe.toml", text)
    )


def call(name: str, arguments: tuple[str, ...], *fragments: str, prepare: Prepare = lambda folder: None) -> Case:
    return Case(name, arguments, fragments, prepare, needs_data="data" in arguments)


def method(name: str, code: str, *fragments: str) -> Case:
    arguments = (*RESTORATION, "--algorithm", "mine.py", "--json", "result.json")
    return call(f"bench method {name}", arguments, *fragments, prepare=lambda folder: put(folder, "mine.py", code))


def dataset(name: str, plant: Prepare, *fragments: str) -> Case:
    """A dataset with one fault, to be checked."""
    return call(f"check {name}", ("check", "data"), *fragments, prepare=lambda folder: plant(folder / "data"))


def put(folder: Path, name: str, content: str | bytes) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)


def picture(folder: Path, name: str, image: np.ndarray) -> None:
    put(folder, name, cv2.imencode(".png", image)[1].tobytes())
