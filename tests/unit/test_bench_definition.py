"""Benchmark definitions: the shipped ones read, broken ones are refused in one line: where and what."""

import pytest

from uwsim.bench.definition import read_definition
from uwsim.bench.run import TASKS
from uwsim.discovery import names
from uwsim.files import shipped
from uwsim.motion_blur import estimators

GOOD = {
    "task": '"blur"', "description": '"What."', "dataset": '"tiny"', "do_nothing": '"none"',
    "quick_cases": "2",
}  # fmt: skip


def write(folder, **changes):
    lines = {**GOOD, **changes}
    path = folder / "mine.toml"
    path.write_text("\n".join(f"{key} = {value}" for key, value in lines.items() if value is not None))
    return str(path)


@pytest.mark.parametrize("name", sorted(path.stem for path in shipped("benchmarks").glob("*.toml")))
def test_shipped_definitions_name_algorithms_that_exist(name):
    title, definition = read_definition(name)
    known = names(TASKS[definition.task].package)
    assert title == name
    assert definition.do_nothing in known
    assert definition.oracle in {*known, None}
    assert set(definition.algorithms or ()) <= {*known, *definition.variants}
    assert {variant.blur_from for variant in definition.variants.values()} <= {*names(estimators), None}
    assert {variant.algorithm for variant in definition.variants.values()} <= set(known)


def test_a_path_is_read(tmp_path):
    assert read_definition(write(tmp_path, algorithms='["none"]'))[1].algorithms == ("none",)


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"speed": "1"}, ["speed", "unknown key", "quick_cases"]),
        ({"dataset": None}, ["dataset", "missing"]),
        ({"quick_cases": "0"}, ["quick_cases", "0", ">= 1"]),
        ({"quick_cases": '"2"'}, ["quick_cases", "'2'"]),
        ({"task": '"colour"'}, ["task", "colour", "restoration"]),
        ({"algorithms": '["none", "none"]'}, ["algorithms", "none", "once"]),
        ({"algorithms": '["clahe"]'}, ["do_nothing", "none", "clahe"]),
        ({"description": '""'}, ["description"]),
        ({"task": "blur"}, ["TOML"]),
    ],
)
def test_errors_are_one_line_with_file_key_and_what_is_allowed(tmp_path, changes, parts):
    with pytest.raises(ValueError) as caught:
        read_definition(write(tmp_path, **changes))
    text = str(caught.value)
    assert "\n" not in text
    assert all(part in text for part in ["mine.toml", *parts]), text


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ValueError, match="restoration"):
        read_definition("colour")
