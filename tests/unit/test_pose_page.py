"""The page of poses from pictures: its numbers are those of the records, its printed ones the dissertation's."""

import dataclasses

import pytest

from uwsim import commands
from uwsim.bench import pose
from uwsim.bench.judged import NO, YES
from uwsim.bench.pnp_page.printed import printed
from uwsim.bench.pose_page import goals, page, tables
from uwsim.bench.pose_page.study import OF_COLUMN, PictureStudy
from uwsim.bench.records import Record, Result
from uwsim.metrics import METRICS

METHODS = ("frontal", *OF_COLUMN.values(), "best", "port_refined", "pinhole_ignoring_port", "port_refined_search",
           "port_refined_clahe", "port_refined_deblurred", "oracle_corners")  # fmt: skip


def condition(group, *, far=400, aside=0, water="tank_clear", port="flat, 5 + 6 mm", blur=0.0, marks="6 spheres"):
    return {"group": group, "marks": marks, "water": water, "distance_mm": far, "off_axis_mm": aside, "tilt_deg": 16.0,
            "port": port, "blur_px": blur}  # fmt: skip


CONDITIONS = {
    "000000": condition("bipyramid"),
    "000001": condition("bipyramid", aside=50),
    "000002": condition("bipyramid_turbid", water="tank_high"),
    "000003": condition("thick_port", far=300, aside=80, port="flat, 30 + 12 mm"),
    "000004": condition("random", marks="10 spheres"),
    "000005": condition("bipyramid_motion", blur=8.0),
    "000006": condition("apriltag", water="tank_low", marks="markers", port="none"),
}


def study(change=lambda case, method, metric, value: value):
    """Return a study in which every method is as far off as its place in METHODS says, less `change`."""
    records = []
    for case in CONDITIONS:
        for place, method in enumerate(METHODS):
            for metric in pose.STATISTICS:
                value = 100.0 if metric.endswith("percent") and "error" not in metric else 0.01 * (place + 1)
                value = change(case, method, metric, value)
                records.append(
                    Record(case, method, (), metric, value, METRICS[metric].unit, METRICS[metric].better, "")
                )
    origin = {
        "definition": {"task": "pose", "do_nothing": "frontal", "oracle": "oracle_corners"}, "cases": len(CONDITIONS),
        "dataset": {"name": "made", "seed": 1, "sha256": "0"}, "quick": False, "conditions": CONDITIONS,
        "statistics": pose.STATISTICS, "cameras": [], "summaries": [],
    }  # fmt: skip
    return PictureStudy(Result(benchmark="pose", provenance=origin, records=tuple(records)))


def test_our_numbers_stand_below_the_printed_ones():
    """Expected: table 5.2 of rotation holds the printed row and the records' means below it, under the same heads.
    Negative control: other records, another row."""
    table = next(one for one in printed().table if one.number == "5.2")
    lines = tables.beside_printed(table, study(), "rotation_deg").splitlines()
    heads = [cell.strip() for cell in lines[0].split("|")[1:-1]]
    first, second = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:4])
    assert heads[2:11] == list(printed().columns)
    assert first[2:11] == [f"{value:.2f}" for value in table.rotation_deg["0"]]
    assert second[1] == "here, 1"
    assert second[2:11] == [f"{0.01 * (2 + place):.2f}" for place in range(9)]
    other = study(lambda case, method, metric, value: 2 * value)
    assert tables.beside_printed(table, other, "rotation_deg") != "\n".join(lines)
    # a row without pictures here
    assert "here, 0" in tables.beside_printed(table, study(), "translation_percent")


def test_who_has_fewer_poses_is_named():
    """Expected: DLT with a pose in one of two pictures of the tables is named with that, and all others together.
    Negative control: with a pose in each, none is named."""

    def refuses(case, method, metric, value):
        return 0.0 if (case, method, metric) == ("000001", "dlt", "detected_percent") else value

    assert tables.poses(study(refuses)).endswith("a pose: DLT in 50.0 %, all others in each.")
    assert tables.poses(study()).endswith("a pose: all in each.")


def test_goals_follow_the_records():
    made = {goal.text.partition(":")[0]: goal for goal in goals.of_pictures(printed(), study())}
    assert made["ten points"].met
    assert made["port_refined"].found.endswith("of 4 entries")

    def wrong(case, method, metric, value):
        return 50.0 if metric in ("points_right_percent", "rotation_error_deg") else value

    worse = {goal.text.partition(":")[0]: goal for goal in goals.of_pictures(printed(), study(wrong))}
    assert worse["ten points"].met is False and worse["port_refined"].met is False


def test_the_claims_on_real_pictures_are_judged_on_rendered_ones():
    found = goals.claims(printed(), study())
    assert set(found) == {"consistent", "off_axis_real"}
    assert found["off_axis_real"].word == YES

    def far_off(case, method, metric, value):
        return 30.0 if case == "000001" and metric in ("rotation_error_deg", "translation_error_percent") else value

    assert goals.claims(printed(), study(far_off))["off_axis_real"].word == NO


def test_the_folder_holds_page_figure_and_records(tmp_path):
    result = study().result
    written = page.write(tmp_path / "pose", result=result, dataset=None)
    text = written.read_text()
    for words in ("Table 5.1, 200 mm", "AprilTags", "by a search", "flat, 30 + 12 mm", "six spheres, 8 px"):
        assert words in text
    assert {file.name for file in (tmp_path / "pose").iterdir()} == {"README.md", "distance.png", page.JSON}


def test_a_result_of_another_dataset_has_a_page_too(tmp_path):
    result = study().result
    renamed = {case: one | {"group": "markers"} for case, one in CONDITIONS.items()}
    other = dataclasses.replace(result, provenance=result.provenance | {"conditions": renamed})
    text = page.write(tmp_path / "pose", result=other, dataset=None).read_text()
    assert "## In short" in text and "distance.png" not in text
    assert "Table 5.1" not in text and "## Motion" not in text


@pytest.mark.parametrize("task", ["pose"])
def test_the_command_line_knows_the_page(task):
    assert commands.page_of("any", task, algorithms=["x"]) is page
