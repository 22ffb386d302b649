"""The layers of a stored frame sum to its picture, read from the file without the project's reader.

Setup: a board in turbid water, in motion, with the shares on request, written and read back by OpenEXR alone.
Expected: direct + forward_scatter + backscatter = radiance in every pixel and band to the precision of float32; of
`direct` and `backscatter` the shares on request are no more than the whole; where nothing is seen nothing is direct.
Tolerance: round-off, 2 units in the last place of float32. Negative control: one layer of half precision is enough to
miss it, one left out misses it by far.
"""

import numpy as np
import OpenEXR
import pytest

from uwsim.dataset.frame import write_frame
from uwsim.dataset.make import make_frame
from uwsim.render.smooth import Options
from uwsim.scene.load import scene_values
from uwsim.scene.models import Scene

LAYERS = ("direct", "forward_scatter", "backscatter")


@pytest.fixture(scope="module")
def stored(tmp_path_factory, llvm_spectral) -> dict[str, np.ndarray]:
    """Return the pictures of a stored frame by name, (H, W) or (H, W, C)."""
    values, _ = scene_values("tank_markers")
    values["water"] = {"name": "tank_medium"}
    values["rig"]["camera"] |= {"width_px": 48, "height_px": 36}
    values["rig"]["motion"] = {"blur_length_px": 4.0, "blur_angle_deg": 30.0}
    values["bodies"] = values["bodies"][:1]
    folder = tmp_path_factory.mktemp("frames") / "000000"
    made = make_frame(
        Scene.model_validate(values), name="000000", group="g", seed=1, frame=0, samples_per_pixel=32, batches=4,
        options=Options(orders=True),
    )  # fmt: skip
    write_frame(folder, **made)
    found = {}
    with OpenEXR.File(str(folder / "frame.exr"), separate_channels=True) as file:
        for part in file.parts:
            channels = {name.rpartition(".")[2]: channel.pixels for name, channel in part.channels.items()}
            order = next(order for order in ("RGB", "XY", "Y") if set(order) == set(channels))
            stacked = np.stack([channels[name] for name in order], axis=-1)
            found[part.name()] = stacked[..., 0] if order == "Y" else stacked
    return found


def missed(stored: dict[str, np.ndarray], layers: list[np.ndarray]) -> float:
    """Return by how many units in the last place of the picture a sum of layers misses it at most."""
    radiance = stored["radiance"]
    return float((np.abs(sum(layers, np.zeros(radiance.shape)) - radiance) / np.spacing(radiance)).max())


def test_layers_in_the_file_sum_to_the_picture(stored):
    layers = [stored[name].astype(float) for name in LAYERS]
    assert all(stored[name].dtype == np.float32 and stored[name].max() > 0 for name in (*LAYERS, "radiance"))
    assert stored["radiance"].min() > 0
    off = missed(stored, layers)
    print(f"off by {off:.2f} units in the last place")
    assert off <= 2
    halved = [layers[0].astype(np.float16).astype(float), *layers[1:]]
    assert missed(stored, halved) > 100
    for index in range(3):
        assert missed(stored, layers[:index] + layers[index + 1 :]) > 1e4


def test_shares_are_no_more_than_their_layers(stored):
    assert np.all(stored["direct_unscattered"] <= stored["direct"] * (1 + 1e-6))
    assert np.all(stored["backscatter_single"] <= stored["backscatter"] * (1 + 1e-6))
    assert stored["backscatter_single"].mean() < 0.999 * stored["backscatter"].mean()
    assert np.any(stored["backscatter_single"] > stored["direct"])  # control: the exchanged ones do not hold
    # farther from the edge than the streak: no pixel there has seen the board at any time
    seen = stored["instance"] > 0
    rows, columns = np.nonzero(seen)
    outside = np.ones_like(seen)
    outside[max(rows.min() - 4, 0) : rows.max() + 5, max(columns.min() - 4, 0) : columns.max() + 5] = False
    assert outside.sum() > 50
    assert not stored["direct"][outside].any() and stored["direct"][seen].min() > 0
