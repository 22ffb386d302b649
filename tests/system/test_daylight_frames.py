"""Scenes in daylight, without a lamp, and with added waters: from the file to a frame that the checks accept."""

import numpy as np
import pytest

from uwsim.render import frame, stopping, variants
from uwsim.scene import truth
from uwsim.scene.load import load_scene


@pytest.fixture(scope="module", autouse=True)
def _variant():
    variants.use("llvm_ad_spectral")


def small(name: str, *, width_px: int = 24, height_px: int = 18):
    """Return a shipped scene with few pixels."""
    scene = load_scene(name)
    camera = scene.rig.camera.model_copy(update={"width_px": width_px, "height_px": height_px})
    return scene.model_copy(update={"rig": scene.rig.model_copy(update={"camera": camera})})


def rendered(name: str, **size):
    scene = small(name, **size)
    return scene, frame.render_frame(
        scene, until=stopping.Until(samples_per_batch=16, batches=2), seed=1, frame=0
    ).buffers


def test_a_frame_in_daylight_alone():
    """Sun and sky light everything; the sun's transmission lies between 0 and 1 and favours green over red; the twin
    without water is brighter; bands and white balance are those of the daylight."""
    scene, buffers = rendered("shallow_daylight")
    body = buffers["instance"] > 0
    assert all(np.isfinite(buffers[name]).all() for name in ("radiance", "water_free", "transmission"))
    assert (buffers["radiance"] > 0).all()
    seen = buffers["transmission"][body]
    assert (seen >= 0).all()
    assert (seen <= 1).all()
    red, green, _ = seen[seen[:, 1] > 0].mean(axis=0)
    assert 0 < red < green < 1
    assert buffers["water_free"][body].mean() > buffers["direct"][body].mean()
    assert truth.water_bands(scene)["weighting"] == "camera response x daylight spectrum"
    assert np.all(np.array(truth.sensor_constants(scene)["white_balance"]) >= 1)


@pytest.mark.slow
def test_added_water_dims_the_transmission():
    """The plume and the layer take light on the way: where they are in view, transmission falls below that without."""
    scene, buffers = rendered("plume")
    clear = scene.model_copy(update={"added_water": ()})
    without = frame.render_frame(clear, until=stopping.Until(samples_per_batch=8, batches=2), seed=1, frame=0).buffers
    ratio = buffers["transmission"][..., 1] / without["transmission"][..., 1]
    assert ratio.max() <= 1 + 1e-5
    assert ratio.min() < 0.9
    assert np.median(ratio[:, -4:]) < np.median(ratio[:, :4])  # the plume stands on the right


def test_the_description_of_a_frame_in_daylight():
    """Sun, sky and added water stand in frame.json as the scene gives them; a scene without has neither."""
    from uwsim.dataset.make import make_frame

    def described(name):
        made = make_frame(small(name, width_px=8, height_px=6), name="f", group="g", seed=1, frame=0,
                          samples_per_pixel=4, batches=2)  # fmt: skip
        return made["info"]

    day = described("shallow_daylight")
    scene = load_scene("shallow_daylight")
    assert day.daylight.sun_zenith_deg == scene.daylight.sun_zenith_deg
    assert day.daylight.refractive_index == scene.water.refractive_index
    assert np.trapezoid(day.daylight.relative_spectrum_per_nm, day.water.wavelengths_nm) == pytest.approx(1, abs=1e-6)
    assert day.added_water == ()
    plume = described("plume")
    assert [added["kind"] for added in plume.added_water] == [a.kind for a in load_scene("plume").added_water]
