"""Records, summaries and tables: what is null, what is counted, how it reads and comes back."""

import json
import math

import pytest

from uwsim.bench import records
from uwsim.bench.records import Record, Result, record_from_score, result_from_dict, summarise


def record(case="all", algorithm="none", value=1.0, **more) -> Record:
    return Record(case, algorithm, (), "psnr", value, "dB", "higher", **more)


def result(*rows: Record) -> Result:
    return Result("restoration", {"definition": {"do_nothing": "none", "oracle": "oracle"}}, rows)


def test_a_finite_score_is_the_value():
    assert record_from_score(record(), 2.5).value == 2.5


def test_identical_images_and_failures_are_null_with_their_reason():
    assert record_from_score(record(), math.inf).value is None
    assert record_from_score(record(), math.inf).note == "identical images"
    assert record_from_score(record(), math.nan).note == "no estimate"


@pytest.mark.parametrize(
    ("scores", "statistic", "expected"),
    [
        ([3.0, 1.0, 2.0], "median", 2.0),
        ([1.0, 2.0, 3.0, 10.0], "median", 2.5),
        ([0.0, 100.0, 100.0, 100.0], "mean", 75.0),
        ([1.0, 2.0, math.inf], "median", 2.0),
        ([math.inf, 1.0, math.inf], "median", math.inf),
        ([math.inf, math.inf], "median", math.inf),
        ([math.nan, 1.0, 3.0, math.nan, 2.0], "median", 2.0),
    ],
)
def test_summaries(scores, statistic, expected):
    assert summarise(scores, statistic)[0] == expected


def test_missing_estimates_are_counted_in_the_note():
    assert summarise([math.nan, 1.0], "median") == (1.0, "over 1 of 2 cases")
    value, note = summarise([math.nan], "median")
    assert math.isnan(value)
    assert note == "no estimate"


def test_json_has_no_infinity_and_comes_back_equal(tmp_path):
    made = result(record(), record(case="000001", value=None, note="identical images"))
    made.write(tmp_path / "result.json")
    assert "Infinity" not in (tmp_path / "result.json").read_text()
    assert set(json.loads(made.to_json())) == {"benchmark", "provenance", "records"}
    assert records.read_result(tmp_path / "result.json") == made
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]


@pytest.mark.parametrize("content", [{}, {"records": [{"case": "a"}]}, [], {"records": 3}])
def test_what_is_no_result_is_refused_in_one_line(content):
    with pytest.raises(ValueError, match="not a benchmark result") as caught:
        result_from_dict(content, "file.json")
    assert "\n" not in str(caught.value)


def test_markdown_marks_roles_and_has_units_and_arrows():
    text = records.markdown(
        result(
            record(),
            record(algorithm="mine", value=None, note="not installed: x"),
            record(algorithm="oracle"),
        )
    )
    lines = text.splitlines()
    assert lines[2] == "| algorithm | given | PSNR [dB] ↑ |"
    assert lines[4] == "| none (do-nothing) | - | 1 |"
    assert lines[5] == "| mine | - | not installed: x |"
    assert lines[6] == "| oracle (oracle) | - | 1 |"


def test_markdown_has_a_table_per_summary_and_none_per_case():
    text = records.markdown(result(record(), record(case="uniform"), record(case="000000")))
    assert text.count("| algorithm |") == 2
    assert "000000" not in text


def test_numbers_keep_four_digits_and_round_off_is_named():
    assert records.number(12.3456) == "12.35"
    assert records.number(0.0) == "0"
    assert records.number(3e-14) == "< 1e-9"
