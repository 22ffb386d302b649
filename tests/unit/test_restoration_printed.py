"""The dissertation's printed numbers as data: exact, with notes that hold; broken files are refused."""

import numpy as np
import pytest

from uwsim.bench.restoration_page.printed import Printed, Table, printed
from uwsim.validation import validated


def test_means_of_the_printed_tables_are_those_found_by_hand():
    """Means over the twelve rows, taken once more from the text, to printed digits."""
    known = {
        "6.1": (13.21, 12.34, 18.38, 14.59, 14.19), "6.3": (11.75, 10.13, 16.70, 14.10, 12.87),
        "6.2": (0.446, 0.289, 0.339, 0.225, 0.544), "6.4": (0.407, 0.226, 0.361, 0.088, 0.551),
    }  # fmt: skip
    for table in printed().tables(*known):
        digits = 0.0051 if table.metric == "psnr" else 0.00051
        assert [table.mean(column) for column in table.columns] == pytest.approx(known[table.number], abs=digits)
        assert len(table.rows) == 12


def test_notes_on_printed_tables_hold():
    by_number = {table.number: table for table in printed().table}
    assert by_number["6.1"].rows["2"][4] == 20.52
    assert by_number["6.1"].rows["2"][2] == by_number["6.1"].rows["6"][2] == max(by_number["6.1"].column("WIGF"))
    assert by_number["6.3"].rows["6"][2] == max(by_number["6.3"].column("WIGF")) > 18.74
    assert by_number["6.2"].rows["7"][3] > by_number["6.2"].rows["7"][4]
    risen = [
        column for column in by_number["6.2"].columns if by_number["6.4"].mean(column) > by_number["6.2"].mean(column)
    ]
    assert risen == ["WIGF", "Proposed"]
    assert sum(by_number[number].wins("Proposed") for number in ("6.1", "6.3")) == 1
    rows = by_number["6.5"].rows
    assert [speed for speed, row in rows.items() if row[2] < row[3]] == ["40", "50", "60", "70"]
    late = [row for speed, row in by_number["6.6"].rows.items() if int(speed) >= 50]
    assert max(np.ptp(late, axis=0)) == pytest.approx(0.01)
    assert by_number["3.1"].rows["Proposed"] != by_number["3.3"].rows["Ours"]


def test_a_misprint_is_the_same_method():
    known = printed()
    assert known.name("MCRCR") == "MSRCR"
    assert known.method("WIGF").algorithm == "wgif_detail"
    with pytest.raises(ValueError, match="MSRRC.*allowed: AGCWD"):
        known.name("MSRRC")


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"rows": {"1": (1.0,)}}, "one for each of"),
        ({"notes": ({"row": "3", "text": "x"},)}, "rows and columns of the table"),
        ({"metric": "mse"}, "metric"),
    ],
)
def test_a_broken_printed_table_is_refused(change, part):
    good = {
        "number": "1", "title": "T", "metric": "psnr", "methods": "columns", "columns": ("AGCWD", "MCRCR"),
        "rows": {"1": (1.0, 2.0)},
    }  # fmt: skip
    assert validated(Table, good, where="here").mean("MCRCR") == 2
    with pytest.raises(ValueError, match=part):
        validated(Table, good | change, where="here")


def test_a_printed_method_must_be_known():
    content = printed().model_dump()
    assert validated(Printed, content, where="here") == printed()
    del content["methods"]["Phaseformer"]
    with pytest.raises(ValueError, match="Phaseformer"):
        validated(Printed, content, where="here")
