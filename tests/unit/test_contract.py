"""What every algorithm file found in the folders must do, whoever wrote it."""

import copy
import inspect

import numpy as np
import pytest

from uwsim.camera.lens import Lens
from uwsim.discovery import discover, load_file, missing_packages
from uwsim.images import linear_from_srgb_uint8, srgb_uint8_from_linear
from uwsim.motion_blur import deconvolvers, estimators
from uwsim.motion_blur.estimate import Estimate
from uwsim.motion_blur.kernels import blur
from uwsim.pose import solvers
from uwsim.restoration import algorithms

HEIGHT_PX, WIDTH_PX = 48, 64
LENS = Lens(K=np.array([[400.0, 0, 320], [0, 400, 240], [0, 0, 1]]))
KINDS = ("srgb_uint8", "linear_float32")
PACKAGES = {"restore": algorithms, "estimate": estimators, "deblur": deconvolvers, "solve": solvers}
FOUND = [
    pytest.param(function, module, id=f"{function}-{name}")
    for function, package in PACKAGES.items()
    for name, module in discover(package).items()
]


def picture():
    """Return a smooth 8-bit picture with all three channels different."""
    import cv2

    coarse = np.random.default_rng(0).random((8, 10, 3))
    smooth = cv2.resize(coarse, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
    return (40 + 160 * smooth.clip(0, 1)).astype(np.uint8)


def rig_known():
    """Return what a method with the lamp's model is told of camera, lamp and water."""
    spectrum = np.full(61, 1 / 61)
    return {
        "lens": Lens(K=np.array([[60.0, 0, 32], [0, 60.0, 24], [0, 0, 1]])), "width_px": WIDTH_PX,
        "height_px": HEIGHT_PX, "response": "Nikon 5100 (NPL)", "linear_per_radiance": np.array([40.0, 50.0, 45.0]),
        "lamps": [
            {
                "name": "lamp", "position_m": np.array([0.3, 0, 0]), "direction": np.array([0, 0, 1.0]),
                "radiant_intensity_w_per_sr": 2.0, "relative_spectrum_per_nm": spectrum, "half_angle_deg": 50.0,
            }
        ],
        "water": {
            "name": "grey", "wavelengths_nm": np.arange(400.0, 701, 5), "absorption_per_m": np.full(61, 0.3),
            "scattering_per_m": np.full(61, 0.3),
            "phase_function": {"type": "hg_mixture", "g": [0.9], "weights": np.ones((1, 61))},
        },
        "noise": {"electrons": np.full(3, 1e4), "dark_variance_e2": 16.0},
    }  # fmt: skip


def image_inputs():
    """Return everything that an image method may ask for in NEEDS."""
    z_depth_m = np.broadcast_to(np.linspace(0.8, 2.0, WIDTH_PX), (HEIGHT_PX, WIDTH_PX)).astype(np.float32)
    range_m = (1.05 * z_depth_m).astype(np.float32)
    range_m[:5], attenuation = np.inf, np.array([0.9, 0.4, 0.5])
    transmission = np.exp(-attenuation * range_m[..., None])
    return {
        "range_m": range_m,
        "z_depth_m": np.where(np.isinf(range_m), np.inf, z_depth_m),
        "water": {
            "absorption_per_m": 0.7 * attenuation,
            "scattering_per_m": 0.3 * attenuation,
            "attenuation_per_m": attenuation,
        },
        "lamps": [
            {
                "name": "lamp", "position_m": np.array([0.3, 0, 0]), "direction": np.array([0, 0, 1.0]),
                "radiant_intensity_w_per_sr": 2.0, "spectrum": "white", "half_angle_deg": None,
            }
        ],
        "camera": {
            "K": np.array([[60.0, 0, 32], [0, 60.0, 24], [0, 0, 1]]), "width_px": WIDTH_PX,
            "height_px": HEIGHT_PX, "linear_per_radiance": np.array([40.0, 50.0, 45.0]),
        },
        "rig": rig_known(),
        "backscatter": (0.02 * (1 - transmission)).astype(np.float32),
        "transmission": transmission.astype(np.float32),
        "forward_scatter": (0.01 * transmission).astype(np.float32),
        "direct_gain": transmission.astype(np.float32),
        "noise_std": np.full((HEIGHT_PX, WIDTH_PX, 3), 0.01, np.float32),
        "sharp": linear_from_srgb_uint8(picture()),
        "blur": Estimate(6.0, 30.0),
    }  # fmt: skip


def pose_inputs(target_m):
    """Return (points_m, points, inputs) of two exact views of a target."""
    turns = np.array([[[1.0, 0, 0], [0, -1, 0], [0, 0, -1]], [[0.8, 0, 0.6], [0, -1, 0], [0.6, 0, -0.8]]])
    camera_m = target_m @ np.swapaxes(turns, 1, 2) + [[[0.1, 0.05, 1.0]], [[-0.1, 0.0, 1.5]]]
    points = camera_m[..., :2] / camera_m[..., 2:]
    pixels = 400 * points + [320, 240]
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = turns, [[0.1, 0.05, 1.0], [-0.1, 0.0, 1.5]]
    known = {"true_points": points.copy(), "pixels": pixels, "true_pixels": pixels.copy(), "lens": LENS}
    known["true_pose"] = poses
    known["covariance_px2"] = np.tile(0.04 * np.eye(2), (*points.shape[:2], 1, 1))
    return np.tile(target_m, (2, 1, 1)), points, known


def targets(module):
    grid = np.stack(np.meshgrid([-0.1, 0.0, 0.1], [-0.1, 0.0, 0.1]), axis=-1).reshape(9, 2)
    solid = np.column_stack([grid, 0.05 * np.array([1, -1, 1, 1, 1, -1, -1, 1, 1])])
    flat = np.column_stack([grid, np.zeros(9)])
    kinds = [(solid, getattr(module, "SOLID_OK", True)), (flat, module.PLANAR_OK)]
    return [target for target, allowed in kinds if allowed]


def called(function, module, *arguments, known):
    """Call the module's function with what NEEDS names; fail if it writes into anything it was given."""
    inputs = {name: known[name] for name in module.NEEDS}
    before = copy.deepcopy((arguments, inputs))
    output = getattr(module, function)(*arguments, **inputs)
    assert_same(before, (arguments, inputs), "modifies its input")
    return output


def assert_same(first, second, what):
    if isinstance(first, np.ndarray):
        assert np.array_equal(first, second, equal_nan=first.dtype.kind == "f"), what
    elif isinstance(first, dict):
        assert first.keys() == second.keys(), what
        for key in first:
            assert_same(first[key], second[key], what)
    elif isinstance(first, tuple | list):
        assert len(first) == len(second), what
        for one, other in zip(first, second, strict=True):
            assert_same(one, other, what)
    elif isinstance(first, Lens):
        assert_same((first.K, first.coefficients), (second.K, second.coefficients), what)
    else:
        assert first == second, what


def check_header(function, module):
    assert module.__doc__, "has no docstring"
    assert "Source:" in module.__doc__ + (inspect.getdoc(getattr(module, function)) or ""), "names no source"
    assert isinstance(module.NEEDS, tuple), "NEEDS is no tuple"
    known = set(pose_inputs(np.zeros((4, 3)))[2]) if function == "solve" else set(image_inputs())
    assert set(module.NEEDS) <= known, "NEEDS what nobody hands in"
    if function != "solve":
        assert module.INPUT in KINDS, "INPUT is of no known kind"


def check_restore(module):
    image = picture() if module.INPUT == "srgb_uint8" else linear_from_srgb_uint8(picture())
    check_image_method("restore", module, image)


def check_deblur(module):
    assert module.NEEDS == ("blur",), "NEEDS more than the blur"
    moved = blur(linear_from_srgb_uint8(picture()), length_px=6, angle_deg=30)
    image = linear_from_srgb_uint8(srgb_uint8_from_linear(moved))
    check_image_method("deblur", module, image)
    assert_same(module.deblur(image, blur=Estimate(0.0, 0.0)), image, "changes a picture without blur")


def check_image_method(function, module, image):
    first = called(function, module, image, known=image_inputs())
    assert isinstance(first, np.ndarray), "returns no array"
    assert first.dtype == image.dtype, "changes the type"
    assert first.shape == image.shape, "changes the shape"
    assert np.all(np.isfinite(first)), "returns NaN or infinity"
    assert first.min() >= 0, "leaves the range"
    assert first.max() <= (255 if image.dtype == np.uint8 else 1), "leaves the range"
    assert not np.shares_memory(first, image), "returns its input"
    assert_same(first, called(function, module, image, known=image_inputs()), "differs from call to call")


def check_estimate(module):
    image = picture() if module.INPUT == "srgb_uint8" else linear_from_srgb_uint8(picture())
    first = called("estimate", module, image, known=image_inputs())
    assert np.isfinite(float(first.length_px)), "length is no number"
    assert first.length_px >= 0, "length is negative"
    assert 0 <= first.angle_deg < 180, "angle leaves the range"
    again = called("estimate", module, image, known=image_inputs())
    assert_same(first, again, "differs from call to call")


def check_solve(module):
    assert module.MINIMUM_POINTS >= 1
    for target_m in targets(module):
        points_m, points, known = pose_inputs(target_m)
        first = called("solve", module, points_m, points, known=known)
        assert first.rotation.shape == (2, 3, 3), "rotation has another shape"
        assert first.translation_m.shape == (2, 3), "translation has another shape"
        assert first.ok.shape == (2,), "ok has another shape"
        assert first.ok.dtype == bool, "ok is not bool"
        assert first.ok.all(), "fails on exact points"
        identity = first.rotation @ np.swapaxes(first.rotation, 1, 2)
        assert np.allclose(identity, np.eye(3), atol=1e-6), "rotation is none"
        assert np.all(first.translation_m[:, 2] > 0), "target is behind the camera"
        assert_same(tuple(first), tuple(called("solve", module, points_m, points, known=known)), "differs")
        few = module.MINIMUM_POINTS - 1
        with pytest.raises(ValueError):
            fewer = {name: value if name == "lens" else value[:, :few] for name, value in known.items()}
            called("solve", module, points_m[:, :few], points[:, :few], known=fewer)


CHECKS = {"restore": check_restore, "estimate": check_estimate, "deblur": check_deblur, "solve": check_solve}


@pytest.mark.parametrize("function, module", FOUND)
def test_contract(function, module):
    check_header(function, module)
    if missing := missing_packages(module):
        pytest.skip(f"not installed: {', '.join(missing)}")
    CHECKS[function](module)


@pytest.mark.parametrize("function", PACKAGES)
def test_do_nothing_entry_and_oracle_exist(function):
    names = set(discover(PACKAGES[function]))
    assert names & {"none", "frontal"}
    # a deconvolver given the true blur is the oracle
    assert function == "deblur" or any(name.startswith("oracle_") for name in names)


HEADER = '"""Text.\n\nSource: none.\n"""\nimport numpy as np\nINPUT = "srgb_uint8"\nNEEDS = ()\n'
_RANDOM = "np.random.default_rng().integers(0, 9, image.shape, np.uint8)"
BROKEN = {
    "modifies its input": "def restore(image):\n    image[0] = 0\n    return image.copy()\n",
    "returns its input": "def restore(image):\n    return image\n",
    "changes the type": "def restore(image):\n    return image / 255\n",
    "changes the shape": "def restore(image):\n    return image[1:].copy()\n",
    "returns NaN": 'INPUT = "linear_float32"\ndef restore(image):\n    return image * np.float32(np.nan)\n',
    "leaves the range": 'INPUT = "linear_float32"\ndef restore(image):\n    return image + np.float32(1)\n',
    "differs": f"def restore(image):\n    return image ^ {_RANDOM}\n",
}


@pytest.mark.parametrize("fault", BROKEN)
def test_control_a_broken_method_is_caught(fault, tmp_path):
    path = tmp_path / "broken.py"
    path.write_text(HEADER + BROKEN[fault])
    module = load_file(path)
    check_header("restore", module)
    with pytest.raises(AssertionError, match=fault):
        check_restore(module)


@pytest.mark.parametrize(
    "old, new, fault",
    [
        ("Source:", "From:", "source"), ("()", '["range_m"]', "tuple"), ("()", '("truth",)', "nobody"),
        ("srgb_uint8", "jpeg", "INPUT"),
    ],
)  # fmt: skip
def test_control_a_broken_header_is_caught(old, new, fault, tmp_path):
    path = tmp_path / "broken.py"
    path.write_text(HEADER.replace(old, new) + "def restore(image):\n    return image.copy()\n")
    with pytest.raises(AssertionError, match=fault):
        check_header("restore", load_file(path))
