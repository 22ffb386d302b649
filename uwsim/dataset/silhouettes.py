"""Whole silhouettes: which pixels would see a body if it were alone. A frame on disk knows only what is seen."""

from collections.abc import Callable

import numpy as np

from uwsim.dataset.frame import Frame
from uwsim.dataset.recipe import Recipe, draw_scene
from uwsim.dataset.store import Dataset
from uwsim.render import film, variants
from uwsim.render.checkpoint import fingerprint
from uwsim.render.geometry import geometry
from uwsim.scene.models import Scene
from uwsim.validation import validated


def silhouettes(dataset: Dataset) -> Callable[[Frame], dict[int, np.ndarray]]:
    """Return what makes, of a frame, {instance: mask (3 H, 3 W) bool} of the bodies that it sees.

    Rays through pixel centres at mid-exposure (of the pixel's row), on a canvas three times as wide and high with the
    picture in its middle, so that what the picture's edge cuts off counts too. The scenes are drawn again from the
    dataset's recipe. Raises ValueError in one line where they are not those of the dataset any more.
    """
    where = dataset.folder / "dataset.json"
    recipe = validated(Recipe, dataset.manifest["recipe"], where=where)
    scenes = [draw_scene(recipe, frame, where=where) for frame in range(recipe.frames)]
    if fingerprint(scenes) != dataset.manifest["scenes_sha256"]:
        raise ValueError(f"{where}: the recipe's scenes, or the files that they name, are not those of the dataset")
    variants.use()
    return lambda frame: _of_frame(scenes[frame.info.frame], frame)


def _of_frame(scene: Scene, frame: Frame) -> dict[int, np.ndarray]:
    wide = _widened(scene)
    seen = set(np.unique(frame.buffer("instance")).tolist()) - {0}
    names = {body.instance: body.name for body in frame.info.bodies}
    found = {}
    for instance in sorted(seen):
        bodies = tuple(body for body in scene.bodies if body.name == names[instance])
        alone = wide.model_copy(update={"bodies": bodies})
        found[instance] = geometry(alone, film.view_of(alone))["instance"] > 0
    return found


def _widened(scene: Scene) -> Scene:
    """Return the scene with a picture three times as wide and high around the same pixels, row by row at its time."""
    camera, exposure = scene.rig.camera, scene.exposure
    fx, fy, cx, cy = (float(value) for value in camera.K[(0, 1, 0, 1), (0, 1, 2, 2)])
    wider = {
        "width_px": 3 * camera.width_px, "height_px": 3 * camera.height_px, "horizontal_fov_deg": None,
        "K_px": (fx, fy, cx + camera.width_px, cy + camera.height_px), "housing": None,
    }  # fmt: skip
    rig = scene.rig.model_copy(update={"camera": camera.model_copy(update=wider)})
    slower = exposure.model_copy(update={"readout_s": 3 * exposure.readout_s})
    return scene.model_copy(update={"rig": rig, "exposure": slower})
