"""Scores kept in a file: what is finished is not scored again, and belongs to one benchmark, dataset and algorithm."""

import json
import math

import pytest
import synthetic

from uwsim.bench.run import TASKS, run


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


def without_times(result) -> list:
    """Return the records but for the milliseconds; NaN as None."""
    return [
        (r.case, r.algorithm, r.metric, None if r.value is None or math.isnan(r.value) else r.value, r.note)
        for r in result.records
        if r.metric != "milliseconds"
    ]


def scored(dataset, algorithms=("none", "clahe", "oracle_inverse"), **options):
    """Return the result of a few fast methods."""
    return run("restoration", dataset, algorithms=list(algorithms), **options)


def test_a_killed_run_goes_on(dataset, tmp_path, monkeypatch):
    """Expected: of three cases the first two lines and half of the third are there: one case is scored again, and the
    result is that of an uninterrupted run. Control: without the checkpoint all are."""
    whole = scored(dataset)
    file = tmp_path / "scores.jsonl"
    scored(dataset, checkpoint=file)
    lines = file.read_text().splitlines(keepends=True)
    assert len(lines) == 4
    file.write_text("".join(lines[:3]) + lines[3][:20])

    asked = []
    score = TASKS["restoration"].score
    monkeypatch.setitem(
        TASKS, "restoration", synthetic_task(TASKS["restoration"], lambda *a: asked.append(a[3].name) or score(*a))
    )
    resumed = scored(dataset, checkpoint=file, resume=True)
    assert set(asked) == {"000003"}
    assert without_times(resumed) == without_times(whole)
    asked.clear()
    again = scored(dataset, checkpoint=file, resume=True)
    assert asked == []
    assert again.records == resumed.records
    scored(dataset)
    assert set(asked) == {"000000", "000001", "000003"}


def synthetic_task(task, score):
    """Return a task with another function that scores."""
    import dataclasses

    return dataclasses.replace(task, score=score)


@pytest.mark.parametrize(
    ("content", "resume", "message"),
    [
        (None, True, "no such file"),
        ("scene.toml", False, "exists already"),
        ("not JSON\n", True, "not readable"),
        ('{"benchmark": "restoration"}\n', True, "another definition"),
        ('{"benchmark": "blur"}\n', True, "another benchmark"),
    ],
)
def test_files_of_something_else_are_refused(dataset, tmp_path, content, resume, message):
    file = tmp_path / "scores.jsonl"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ValueError, match=message) as problem:
        scored(dataset, checkpoint=file, resume=resume)
    assert "\n" not in str(problem.value)
    assert (file.read_text() if file.exists() else None) == content


def test_another_algorithm_is_told_apart(dataset, tmp_path):
    file = tmp_path / "scores.jsonl"
    scored(dataset, checkpoint=file)
    mine = tmp_path / "mine.py"
    mine.write_text("INPUT = 'srgb_uint8'\nNEEDS = ()\n\n\ndef restore(image):\n    return image\n")
    with pytest.raises(ValueError, match="another algorithms"):
        scored(dataset, algorithms=[str(mine)], checkpoint=file, resume=True)
    stored = json.loads(file.read_text().splitlines()[0])
    assert "mine" not in stored["algorithms"]


def test_resume_needs_a_checkpoint(dataset):
    with pytest.raises(ValueError, match="--resume: got no --checkpoint"):
        scored(dataset, resume=True)


def test_workers_score_as_one_process_does(dataset, tmp_path):
    """Expected: the same records but for the times; the scores of all cases are kept. Control: other algorithms."""
    file = tmp_path / "scores.jsonl"
    alone, together = scored(dataset), scored(dataset, workers=2, checkpoint=file)
    assert without_times(together) == without_times(alone)
    assert len(file.read_text().splitlines()) == 4
    assert without_times(scored(dataset, algorithms=["none"])) != without_times(alone)


def test_a_worker_that_fails_says_so_in_one_line(dataset, tmp_path):
    mine = tmp_path / "mine.py"
    mine.write_text("INPUT = 'srgb_uint8'\nNEEDS = ()\n\n\ndef restore(image):\n    return image[:4]\n")
    with pytest.raises(ValueError, match=r"mine: case 00000\d") as problem:
        scored(dataset, algorithms=[str(mine)], workers=2)
    assert "\n" not in str(problem.value)
