"""Frames with layers by order of scattering and with denoised layers, by the command line."""

import importlib.util
import json

import numpy as np
import pytest

from tests.system.test_noise_target import SCENE
from uwsim import cli
from uwsim.dataset.check import check_frame
from uwsim.dataset.frame import ORDERS, read_frame
from uwsim.render import smooth

SAMPLES = ["--samples", "32", "--batches", "4"]


def run(monkeypatch, *arguments) -> int:
    monkeypatch.setattr("sys.argv", ["uwsim", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def test_options_add_to_a_frame_and_change_nothing_else(scene, tmp_path, monkeypatch, capsys):
    """Expected: with --orders the other buffers are the same bytes; with --denoise the layers alone differ,
    and frame.json and the output name denoiser and bias. Control: the plain frame has neither."""
    assert run(monkeypatch, "render", scene, "--out", tmp_path / "plain", *SAMPLES) == 0
    assert run(monkeypatch, "render", scene, "--out", tmp_path / "orders", *SAMPLES, "--orders") == 0
    plain, orders = (read_frame(tmp_path / name) for name in ("plain", "orders"))
    check_frame(orders)
    assert set(orders.buffer_names) - set(plain.buffer_names) == set(ORDERS)
    assert all(np.array_equal(plain.buffer(name), orders.buffer(name)) for name in plain.buffer_names)
    assert not plain.info.options.orders and plain.info.options.denoiser is None
    if importlib.util.find_spec(smooth.PACKAGE) is None:
        pytest.skip(f"the denoiser is an extra: pip install {smooth.PACKAGE}")

    kept = ["--checkpoint", tmp_path / "sums.npz"]
    capsys.readouterr()
    assert run(monkeypatch, "render", scene, "--out", tmp_path / "smooth", *SAMPLES, "--denoise", *kept) == 0
    assert "denoised by Intel Open Image Denoise" in capsys.readouterr().out
    denoised = read_frame(tmp_path / "smooth")
    check_frame(denoised)
    changed = {n for n in plain.buffer_names if not np.array_equal(plain.buffer(n), denoised.buffer(n))}
    assert changed == {"radiance", *smooth.DENOISED}
    stated = json.loads((tmp_path / "smooth" / "frame.json").read_text())["options"]
    assert set(stated["bias"]["radiance"]) == set(stated["denoised_layers"]) == set(smooth.DENOISED)
    # resumed from its sums it is the same, and those are not the sums of a frame without
    again = ["--out", tmp_path / "again", *SAMPLES, *kept, "--resume"]
    assert run(monkeypatch, "render", scene, *again) == 2
    assert "holds another options" in capsys.readouterr().err
    assert run(monkeypatch, "render", scene, *again, "--denoise") == 0
    assert np.array_equal(read_frame(tmp_path / "again").buffer("radiance"), denoised.buffer("radiance"))


def test_a_missing_denoiser_is_one_line_before_anything_is_rendered(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(smooth, "PACKAGE", "no_such_package_here")
    assert run(monkeypatch, "render", scene, "--out", tmp_path / "out", "--denoise") == 2
    error = capsys.readouterr().err
    assert "pip install no_such_package_here" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
