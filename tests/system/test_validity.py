"""`uwsim bench validity` from a recipe with a grid to a table, on two tiny frames."""

import json

from typer.testing import CliRunner

from uwsim.cli import app

RECIPE = """name = "two"
description = "Two turbidities."
seed = 1
samples_per_pixel = 16
batches = 4
orders = true
[set]
"rig.camera.width_px" = 32
"rig.camera.height_px" = 24
[[group]]
name = "relief"
scene = "tank_relief"
set = { "water.name" = "tank_clear" }
[[group.grid]]
set = { "water.particle_factor" = [0.5, 5.0] }
"""


def test_two_frames_are_scored(tmp_path):
    (tmp_path / "two.toml").write_text(RECIPE)
    made = CliRunner().invoke(app, ["generate", str(tmp_path / "two.toml"), "--out", str(tmp_path / "two")])
    assert made.exit_code == 0, made.output
    target = tmp_path / "result.json"
    asked = ["--dataset", str(tmp_path / "two"), "--algorithm", "multistage", "--json", str(target)]
    done = CliRunner().invoke(app, ["bench", "validity", *asked])
    assert done.exit_code == 0, done.output
    content = json.loads(target.read_text())
    conditions = content["provenance"]["conditions"]
    # c is about 0.13 and 0.77 /m, 1 m away
    assert conditions["000000"]["optical_depth"] < 0.3 < conditions["000001"]["optical_depth"]
    values = {
        (record["case"], record["algorithm"]): record["value"]
        for record in content["records"]
        if record["metric"] == "relative_radiance_error"
    }
    # the model knows the scene: nearer than no water at all, and within what 16 samples show
    for case in conditions:
        assert values[case, "multistage"] < 0.5 * values[case, "no_water"]
        assert values[case, "multistage"] < 15


def test_a_page_is_refused_where_there_is_none(tmp_path):
    done = CliRunner().invoke(app, ["bench", "validity", "--algorithm", "multistage", "--out", str(tmp_path / "page")])
    assert done.exit_code != 0
    assert "allowed: validity and validity_chart" in str(done.exception)
