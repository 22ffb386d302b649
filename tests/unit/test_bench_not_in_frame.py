"""A method asks for what a frame does not have: its row says why, and all other scores stay as they are."""

import json
import math
import shutil

import numpy as np
import pytest
import synthetic

from uwsim.bench import restoration, runner
from uwsim.bench.definition import read_definition
from uwsim.bench.page.methods import restoration_section
from uwsim.bench.records import markdown, result_from_dict
from uwsim.bench.restoration import relations
from uwsim.bench.restoration_page import sheets, tables
from uwsim.bench.restoration_page.printed import printed
from uwsim.bench.restoration_page.study import study_of
from uwsim.bench.run import run
from uwsim.dataset import store

REASON = "no lamp in the frame, so no rig"
RIGGED = "NEEDS = ('rig',)\ndef restore(image, *, rig):\n    return 255 - image\n"
DARK = ("000001",)


def without_lamps(folder, names) -> store.Dataset:
    """Take the lamps out of some frames of a dataset and open it."""
    for name in names:
        path = folder / "frames" / name / "frame.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"lamps": []}))
    manifest = json.loads((folder / "dataset.json").read_text()) | {"files": store.checksums(folder)}
    store.write_manifest(folder, manifest)
    return store.open(folder)


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic", frames=(0, 1, 3))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory, lit):
    """Three still frames, the second without a lamp."""
    folder = tmp_path_factory.mktemp("dark") / "synthetic"
    shutil.copytree(lit.folder, folder)
    return without_lamps(folder, DARK)


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    path = tmp_path_factory.mktemp("own") / "mine.py"
    path.write_text(RIGGED)
    return str(path)


@pytest.fixture(scope="module")
def result(dataset, mine):
    return run("restoration", dataset, algorithms=["clahe", mine])


def records(result, algorithm="mine") -> dict:
    return {(r.case, r.metric): r for r in result.records if r.algorithm == algorithm}


def test_a_rig_has_a_lamp(dataset):
    """Control: the same frame has every other input, and a frame with a lamp a rig."""
    makers = restoration.makers(dataset.frame(DARK[0]))
    with pytest.raises(runner.NotInFrame, match=f"^{REASON}$"):
        makers["rig"]()
    assert all(make() is not None for name, make in makers.items() if name != "rig")
    assert restoration.makers(dataset.frame("000000"))["rig"]()["lamps"]


def test_the_run_goes_on_and_the_row_says_why(result, lit, mine):
    """Control: with its lamp the frame has scores; what other methods score is the same."""
    found = records(result)
    assert found["000001", "psnr"].note == REASON
    assert all(record.value is None for (case, _), record in found.items() if case == "000001")
    assert found["000000", "psnr"].value is not None
    assert found["all", "psnr"].value == np.mean([found[case, "psnr"].value for case in ("000000", "000003")])
    assert found["all", "psnr"].note == "over 2 of 3 cases"
    whole = run("restoration", lit, algorithms=["clahe", mine])
    assert records(whole)["000001", "psnr"].value is not None
    assert "no scores" not in markdown(whole)
    for key, record in records(whole, "clahe").items():
        assert key[1] == "milliseconds" or record == records(result, "clahe")[key]


def test_it_is_said_below_the_table_and_comes_back(result):
    text = f"Note: mine has no scores in 1 of 3 cases (000001): {REASON}."
    assert text in markdown(result)
    assert result_from_dict(result.to_dict()) == result
    assert records(result_from_dict(json.loads(result.to_json())))["000001", "psnr"].note == REASON


def test_without_any_score_the_summary_has_the_reason(tmp_path, lit, mine):
    folder = tmp_path / "dark"
    shutil.copytree(lit.folder, folder)
    result = run("restoration", without_lamps(folder, ("000000", "000001", "000003")), algorithms=["clahe", mine])
    assert {r.note for (case, _), r in records(result).items() if case == "all"} == {REASON}
    caption = result.provenance["findings"]["rank_correlations"]["caption"]
    assert "over the means of 3 methods, and over 9 pictures" in caption


def test_only_that_is_turned_into_a_row(dataset, tmp_path):
    """Control: a method that fails of itself, even so, stops the run in one line."""
    for error in ("ValueError('x')", "__import__('uwsim.bench.runner', fromlist=['x']).NotInFrame('x')"):
        path = tmp_path / "broken.py"
        path.write_text(f"def restore(image):\n    raise {error}\n")
        with pytest.raises(ValueError, match="restoration: broken: case 000000: .*x$") as caught:
            run("restoration", dataset, algorithms=[str(path)])
        assert not isinstance(caught.value, runner.NotInFrame)


def test_shares_and_ranks_leave_out_what_has_no_score(dataset):
    """Control: a number in its place changes the rank."""
    nan = dict.fromkeys(("psnr", "psnr_gain"), math.nan)
    raw, best = {"psnr": 10.0, "psnr_gain": 10.0}, {"psnr": 20.0, "psnr_gain": 20.0}
    shares = relations.relate({"raw": raw, "mine": nan, "best": best}, "raw", "best")
    assert math.isnan(shares["mine"]["oracle_share"])
    assert shares["best"]["oracle_share"] == 1
    assert math.isnan(relations.relate({"raw": raw, "best": nan}, "raw", "best")["raw"]["oracle_share"])
    pairs = [{"a": n, "b": n} for n in range(4)]
    assert relations.rank_correlation([*pairs, {"a": math.nan, "b": 0}], "a", "b") == pytest.approx(1)
    assert relations.rank_correlation([*pairs, {"a": 9, "b": 0}], "a", "b") < 0.9
    assert relations.rank_correlation([*pairs[:2], {"a": math.nan, "b": 0}], "a", "b") is None


def test_pages_leave_the_picture_out_and_say_why(dataset, tmp_path):
    """Setup: lamp_model, which asks for a rig. Control: on the frame with a lamp it is called."""
    result = run("restoration", without_lamps(dataset.folder, DARK), algorithms=["lamp_model"])
    text = restoration_section(dataset.frame(DARK[0]), dataset, result)
    assert f"Left out: lamp_model: {REASON}." in text
    assert "Left out" not in restoration_section(dataset.frame("000000"), dataset, result)
    study = study_of(result, dataset)
    assert f"- lamp model: no scores in 1 of 3 cases: {REASON}." in tables.left_out(study, printed())
    blank = []
    methods = sheets.shown_methods(study, read_definition("restoration")[1])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sheets, "_leave_blank", lambda panel, *words: blank.append(words))
        for number, scene in enumerate(dict.fromkeys(shot.scene for shot in study.cases)):
            sheets.write(study, dataset, tmp_path / f"{number}.jpg", scene=scene, methods=methods)
    assert blank == [("lamp model", REASON)]
    sheets.write(study, dataset, tmp_path / "whole.jpg", scene=study.shots[1].scene, methods=methods)
    assert (tmp_path / "whole.jpg").stat().st_size > 0
