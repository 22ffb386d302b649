"""What an algorithm may see and must return: a broken contract is one line that says who and where."""

import types

import numpy as np
import pytest

from uwsim.bench import runner

IMAGE = np.arange(5 * 4 * 3, dtype=np.uint8).reshape(5, 4, 3)
TRUTH = {"range_m": lambda: np.ones((5, 4)), "water": lambda: {"attenuation_per_m": np.ones(3)}}


def module(**members) -> types.SimpleNamespace:
    return types.SimpleNamespace(**members)


def call(restore, needs=(), kind=None):
    members = {"restore": restore, "NEEDS": needs} | ({"INPUT": kind} if kind else {})
    return runner.image_call(
        module(**members),
        "mine",
        "restore",
        image=IMAGE,
        wanted=tuple(needs),
        makers=TRUTH,
        where="mine: case 1",
    )


def check(output, kind="srgb_uint8"):
    return runner.checked_picture(output, kind=kind, shape=IMAGE.shape, where="mine: case 1")


def test_the_image_arrives_as_stored_or_linear():
    seen = []
    call(lambda image: seen.append(image))
    call(lambda image: seen.append(image), kind="linear_float32")
    assert seen[0].dtype == np.uint8
    np.testing.assert_array_equal(seen[0], IMAGE)
    assert seen[1].dtype == np.float32
    np.testing.assert_array_equal(check(seen[1], "linear_float32"), IMAGE)  # round trip of the sRGB curve


def test_only_what_is_listed_is_passed():
    seen = []
    call(lambda image, **inputs: seen.append(sorted(inputs)))
    call(lambda image, **inputs: seen.append(sorted(inputs)), needs=("water",))
    assert seen == [[], ["water"]]


def test_asking_for_an_unlisted_input_fails():
    with pytest.raises(ValueError, match=r"mine: case 1: TypeError.*range_m"):
        call(lambda image, *, range_m: image, needs=())


def test_what_is_passed_shares_no_memory_with_the_truth():
    truth = {"range_m": np.ones((6, 4))[:5], "water": {"attenuation_per_m": np.ones((2, 3))[0]}}
    makers = {name: (lambda value=value: value) for name, value in truth.items()}
    passed = runner.permitted(("range_m", "water"), makers)
    arrays = [passed["range_m"], passed["water"]["attenuation_per_m"]]
    assert all(array.base is None for array in arrays)
    passed["range_m"][:] = 0
    assert truth["range_m"].min() == 1


def test_the_image_passed_has_no_base_and_must_not_be_modified():
    def vandal(image):
        assert image.base is None
        image[0, 0, 0] += 1
        return image

    before = IMAGE.copy()
    with pytest.raises(ValueError, match="input image was modified"):
        call(vandal)
    np.testing.assert_array_equal(IMAGE, before)


@pytest.mark.parametrize("error", [RuntimeError("two\nlines"), SystemExit(3), KeyError("x")])
def test_exceptions_become_one_line_with_algorithm_and_case(error):
    def restore(image):
        raise error

    with pytest.raises(ValueError, match=f"^mine: case 1: {type(error).__name__}") as caught:
        call(restore)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("output", "kind", "part"),
    [
        (None, "srgb_uint8", "NoneType"),
        (IMAGE.astype(np.float32), "srgb_uint8", "float32"),
        (IMAGE[:4], "srgb_uint8", r"\(4, 4, 3\)"),
        (IMAGE[..., 0], "srgb_uint8", r"\(5, 4\)"),
        (IMAGE, "linear_float32", "uint8"),
        (np.full(IMAGE.shape, np.nan, np.float32), "linear_float32", "60 non-finite"),
        (np.full(IMAGE.shape, 1.5, np.float32), "linear_float32", "1.5"),
        (np.full(IMAGE.shape, -0.1, np.float32), "linear_float32", "-0.1"),
        (np.zeros(IMAGE.shape), "linear_float32", "float64"),
    ],
)
def test_outputs_of_another_kind_are_refused(output, kind, part):
    with pytest.raises(ValueError, match=f"^mine: case 1: returned.*{part}.*allowed"):
        check(output, kind)


@pytest.mark.parametrize("wanted", [("range_m", "water_free"), ["truth"], "range_m", (3,)])
def test_needs_must_be_known_names(wanted):
    with pytest.raises(ValueError, match=r"^mine: NEEDS .*allowed.* range_m|^mine: NEEDS .*range_m, water"):
        runner.needs(module(NEEDS=wanted), "mine", ("range_m", "water"))


def test_a_file_without_needs_gets_nothing():
    assert runner.needs(module(), "mine", ("range_m",)) == ()


def test_input_and_function_are_checked():
    with pytest.raises(ValueError, match="INPUT is 'rgb'.*srgb_uint8, linear_float32"):
        runner.input_kind(module(INPUT="rgb"), "mine")
    with pytest.raises(ValueError, match=r"no function restore\(\)"):
        runner.entry(module(), "mine", "restore")


def test_only_the_call_is_timed():
    def makers_are_slow():
        import time

        time.sleep(0.2)
        return np.ones((5, 4))

    _, elapsed_ms = runner.image_call(
        module(restore=lambda image, range_m: image), "mine", "restore", image=IMAGE, wanted=("range_m",),
        makers={"range_m": makers_are_slow}, where="mine",
    )  # fmt: skip
    assert 0 <= elapsed_ms < 100


def test_missing_packages_are_named():
    assert runner.prepare(module(REQUIRES=("no_such_package_here", "json"))) == ["no_such_package_here"]
