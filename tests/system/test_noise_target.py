"""Renders that end on a noise rule or on time, are interrupted and go on, and say how noisy they are.

The scene has a sensor so noisy that the region rule decides, except where a test says otherwise.
"""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from uwsim import cli
from uwsim.dataset.check import check_frame
from uwsim.dataset.frame import read_frame, write_frame
from uwsim.dataset.make import make_frame
from uwsim.render import checkpoint, stopping
from uwsim.render.checkpoint import Checkpoint
from uwsim.render.stopping import Until

SCENE = """
name = "wall"
description = "a wall and a noisy sensor"
[water]
wavelengths_nm = [400, 550, 700]
absorption_per_m = [0.1, 0.1, 0.6]
scattering_per_m = [0.2, 0.2, 0.2]
phase = { type = "hg_mixture", g = [0.9, -0.4], weights = [0.98, 0.02] }
[rig]
position_m = [0.0, 0.0, -0.6]
look_at_m = [0.0, 1.0, -0.6]
[rig.camera]
width_px = 24
height_px = 16
horizontal_fov_deg = 50.0
response = "Nikon 5100 (NPL)"
[[rig.lamps]]
name = "led"
position_m = [0.0, -0.15, 0.0]
look_at_m = [0.0, 0.0, 1.0]
radiant_flux_w = 10.0
half_angle_deg = 35.0
spectrum = "LED-B3"
[exposure]
time_s = 0.002
[sensor]
read_noise_e = 500.0
[[bodies]]
name = "wall"
kind = "rectangle"
width_m = 1.6
height_m = 0.9
reflectance = 0.3
position_m = [0.0, 1.0, -0.6]
towards_m = [0.0, 0.0, -0.6]
"""
RECIPE = """
name = "noisy"
description = "one frame that cannot meet its rule"
seed = 3
noise = { region = 0.0005, max_samples = 144 }
set = { "rig.camera.width_px" = 16, "rig.camera.height_px" = 12 }
[[group]]
name = "wall"
scene = "scene.toml"
frames = 1
"""
REGION = 0.008


@pytest.fixture(scope="module", autouse=True)
def _variant():
    from uwsim.render import variants

    variants.use()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "recipe.toml").write_text(RECIPE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    from uwsim.scene.load import load_scene

    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(SCENE)
    return load_scene(str(path))


def made(scene, *, seed=0, **options) -> dict:
    return make_frame(scene, name="frame", group="g", seed=seed, frame=0, **options)


@pytest.fixture(scope="module")
def met(scene):
    return made(scene, until=Until(region=REGION))


def run(monkeypatch, capsys, *arguments: str) -> tuple[int, str, str]:
    """Run the command line in this process; return exit code and what it wrote."""
    monkeypatch.setattr(sys, "argv", ["uwsim", *arguments])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return stopped.value.code, *capsys.readouterr()


def test_a_render_ends_when_both_rules_hold(met, tmp_path):
    noise = met["info"].noise
    assert noise.met and noise.region_rule == REGION
    radiance = noise.pictures["radiance"]
    assert radiance.ended_by == "noise" and radiance.region_error_p95 <= REGION and radiance.pixel_rule_met
    assert radiance.batches == stopping.next_check(radiance.batches) > stopping.LEAST_BATCHES
    assert met["info"].samples_per_pixel == radiance.samples_per_pixel == 16 * radiance.batches
    # the twin without water needs fewer samples for the same rules
    assert noise.pictures["water_free"].region_error_p95 <= REGION
    assert noise.pictures["water_free"].batches < radiance.batches
    write_frame(tmp_path / "frame", **met)
    check_frame(read_frame(tmp_path / "frame"))


def test_check_finds_a_frame_that_flatters_itself(met, tmp_path):
    write_frame(tmp_path / "frame", **met)
    entry = json.loads((tmp_path / "frame/frame.json").read_text())
    entry["noise"]["pictures"]["radiance"]["pixel_share_within"] = 0.96
    (tmp_path / "frame/frame.json").write_text(json.dumps(entry))
    with pytest.raises(ValueError, match="pixel_share_within = 0.96"):
        check_frame(read_frame(tmp_path / "frame"))
    entry["noise"]["met"] = False
    (tmp_path / "frame/frame.json").write_text(json.dumps(entry))
    with pytest.raises(ValueError, match=r"noise.met is False"):
        read_frame(tmp_path / "frame")


def test_as_many_batches_make_the_same_bytes(scene, met):
    info = met["info"]
    again = made(scene, samples_per_pixel=info.samples_per_pixel, batches=info.batches)
    for name in ("radiance", "standard_error", "direct", "forward_scatter", "backscatter"):
        assert np.array_equal(again["buffers"][name], met["buffers"][name]), name
    assert np.array_equal(again["image"], met["image"])
    stated = again["info"].noise
    assert stated.region_rule is None and stated.pictures["radiance"].region_rule_met is None
    assert stated.pictures["radiance"].ended_by == "samples"
    assert stated.pictures["radiance"].region_error_p95 == info.noise.pictures["radiance"].region_error_p95


def _region_errors(buffers: dict) -> np.ndarray:
    """Standard errors of region means from those of the pixels, which are independent."""
    squares = stopping.region_means(buffers["standard_error"].astype(float) ** 2)
    height, width = buffers["standard_error"].shape[:2]
    return np.sqrt(squares / (height * width / squares.shape[0] / squares.shape[1]))


def test_the_error_stated_is_the_error_found(scene, met):
    """Two independent renders that met the rule: their region means differ by what the rule says.

    Setup: seeds 0 and 1, region rule 0.8 %.
    Expected: differences over the root sum of squared standard errors have a root mean square of 1.
    Tolerance: Monte Carlo; 64 regions whose bands share wavelengths: standard deviation 0.09 at most, 4 of them.
    """
    other = made(scene, seed=1, until=Until(region=REGION))
    one, two = (stopping.region_means(frame["buffers"]["radiance"].astype(float)) for frame in (met, other))
    expected = np.hypot(_region_errors(met["buffers"]), _region_errors(other["buffers"]))
    assert 0.64 < np.sqrt(np.mean(((one - two) / expected) ** 2)) < 1.36
    stated = np.percentile(_region_errors(met["buffers"]) / one, 95)
    assert stated == pytest.approx(met["info"].noise.pictures["radiance"].region_error_p95, rel=0.3)
    # control: a render of a tenth of the samples is not as good as that
    poor = made(scene, seed=2, samples_per_pixel=16, batches=2)
    difference = stopping.region_means(poor["buffers"]["radiance"].astype(float)) - one
    assert np.sqrt(np.mean((difference / expected) ** 2)) > 1.36


class Interrupt(Exception):
    pass


def _interrupted(scene, path, *, resume: bool, after: int, name: str, until: Until) -> None:
    calls = 0

    def progress(what, done, total):
        nonlocal calls
        calls += what.startswith(name)
        if calls > after:
            raise Interrupt

    with pytest.raises(Interrupt):
        made(scene, until=until, checkpoint=_checkpoint(scene, path, resume=resume), progress=progress)


def _checkpoint(scene, path, *, resume: bool, seed=0) -> Checkpoint:
    identity = checkpoint.identity(scene, seed=seed, frame=0, samples_per_batch=16, variant="llvm")
    return Checkpoint(path, identity=identity, resume=resume)


def test_interrupted_and_continued_makes_the_same_bytes(scene, met, tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "_SAVE_EVERY_S", 0.0)
    path, until = tmp_path / "sums.npz", Until(region=REGION)
    _interrupted(scene, path, resume=False, after=3, name="radiance", until=until)
    assert _checkpoint(scene, path, resume=True).sums("radiance").batches == 3
    _interrupted(scene, path, resume=True, after=7, name="radiance", until=until)
    assert _checkpoint(scene, path, resume=True).sums("radiance").batches == 10
    _interrupted(scene, path, resume=True, after=2, name="water_free", until=until)
    final = made(scene, until=until, checkpoint=_checkpoint(scene, path, resume=True))
    assert final["info"] == met["info"]
    for name, values in met["buffers"].items():
        assert np.array_equal(final["buffers"][name], values), name
    # what is done is not done again, and fewer batches than are there cannot be asked for
    with pytest.raises(ValueError, match="batches of radiance, allowed: at most the 4"):
        made(scene, samples_per_pixel=64, batches=4, checkpoint=_checkpoint(scene, path, resume=True))


def test_a_time_ends_a_render_and_the_frame_says_so(folder, monkeypatch, capsys):
    started = time.monotonic()
    code, output, problems = run(
        monkeypatch, capsys, "render", "scene.toml", "--out", "out", "--noise", "0.01%", "--time", "4s"
    )
    assert (code, problems) == (0, "")
    assert time.monotonic() - started < 60  # two batches of each picture, whatever they take, on a busy machine
    first, line = output.splitlines()
    assert first == "out: wall, 24 x 16"
    assert line.endswith("when the time was up") and "NOT met" in line and "0.01%" in line
    noise = read_frame(folder / "out").info.noise
    assert not noise.met
    assert {one.ended_by for one in noise.pictures.values()} == {"time"}
    assert all(one.batches >= 2 for one in noise.pictures.values())
    check_frame(read_frame(folder / "out"))


def test_a_recipe_with_a_noise_rule_ends_at_its_most_samples(folder, monkeypatch, capsys):
    code, output, problems = run(monkeypatch, capsys, "generate", "recipe.toml", "--out", "data")
    assert (code, problems) == (0, "")
    assert output.splitlines()[1].startswith("1 of 1 frames have more Monte-Carlo noise than their rules allow")
    info = read_frame(folder / "data/frames/000000").info
    assert info.samples_per_pixel == 144 and info.batches == 9
    assert not info.noise.met and info.noise.pictures["radiance"].ended_by == "samples"
    assert run(monkeypatch, capsys, "check", "data")[0] == 0


REFUSED = [
    (("--noise", "1%", "--samples", "64"), ("--samples", "64", "--noise")),
    (("--time", "5s", "--batches", "4"), ("--batches", "4", "--time")),
    (("--noise", "1"), ("--noise", "'1'", "1%")),
    (("--noise", "0%"), ("--noise", "'0%'")),
    (("--time", "60"), ("--time", "'60'", "60s")),
    (("--time", "0s"), ("--time", "'0s'")),
    (("--resume",), ("--resume", "--checkpoint")),
    (("--checkpoint", "none.npz", "--resume"), ("none.npz", "no such file")),
    (("--checkpoint", "scene.toml"), ("scene.toml", "exists already")),
    (("--checkpoint", "scene.toml", "--resume"), ("scene.toml", "not readable")),
    (("--checkpoint", "no/sums.npz"), ("no/sums.npz", "does not exist")),
    (("--geometry-only", "--noise", "1%"), ("--geometry-only", "--noise", "light")),
    (("--variant", "scalar_rgb"), ("--variant", "scalar_rgb", "llvm_ad_spectral, cuda_ad_spectral")),
    (("--geometry-only", "--variant", "llvm_ad_spectral"), ("--geometry-only", "--variant", "light")),
    (("--size", "16384x16384"), ("16384 x 16384", "GB", "allowed")),
]


@pytest.mark.parametrize(("options", "fragments"), REFUSED, ids=lambda value: " ".join(value))
def test_refusals_are_one_line(folder, monkeypatch, capsys, options, fragments):
    monkeypatch.setattr("uwsim.render.memory.available_bytes", lambda: 4 * 10**9)
    code, output, problems = run(monkeypatch, capsys, "render", "scene.toml", "--out", "out", *options)
    assert (code, output) == (2, "")
    assert problems.count("\n") == 1 and all(fragment in problems for fragment in fragments), problems
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "fragment"),
    [
        ("max_samples = 144", "max_samples = 100", "a multiple of samples_per_batch = 16, at least 128"),
        ("region = 0.0005", "region = 0.0", "noise.region"),
        (", max_samples = 144", "", "noise.max_samples"),
        ("seed = 3", "seed = 3\nsamples_per_pixel = 8", "give either samples_per_pixel or noise"),
        ("seed = 3", "seed = 3\nbatches = 4", "none with noise"),
        ("noise = {", "nose = {", "nose"),
        ("max_samples = 144", "max_samples = 144, time_s = 3", "time_s"),
    ],
)
def test_impossible_recipes_are_refused(folder, monkeypatch, capsys, old, new, fragment):
    assert RECIPE.count(old) == 1
    (folder / "recipe.toml").write_text(RECIPE.replace(old, new))
    code, _, problems = run(monkeypatch, capsys, "generate", "recipe.toml", "--out", "data")
    assert code == 2 and problems.count("\n") == 1 and fragment in problems, problems
    assert not (folder / "data").exists()


def test_a_checkpoint_of_another_render_is_refused(folder, scene, monkeypatch, capsys):
    from uwsim.render import variants

    common = ("render", "scene.toml", "--out", "out", "--checkpoint", "sums.npz")
    identity = checkpoint.identity(scene, seed=0, frame=0, samples_per_batch=8, variant=variants.use())
    Checkpoint(folder / "sums.npz", identity=identity, resume=False).store("x", _no_sums(), now=True)
    for options, fragment in (
        (("--seed", "1"), "another seed"),
        (("--size", "12x8"), "another scene"),
        (("--samples", "32", "--batches", "8"), "another samples per batch"),
        (("--noise", "1%"), "another samples per batch"),
    ):
        code, _, problems = run(monkeypatch, capsys, *common, *options, "--resume")
        assert code == 2 and problems.count("\n") == 1 and fragment in problems, problems
    (folder / "scene.toml").write_text(SCENE.replace("reflectance = 0.3", "reflectance = 0.4"))
    assert "another scene" in run(monkeypatch, capsys, *common, "--resume")[2]


def _no_sums():
    from uwsim.render.accumulate import Sums

    return Sums(1, *(np.zeros((1, 1, 1, 3)) for _ in range(4)))


@pytest.mark.slow
def test_killed_and_resumed_on_the_command_line(folder):
    """SIGKILL while the checkpoint is young; the frame in the end is that of an uninterrupted render."""
    code = "from uwsim.render import checkpoint; checkpoint._SAVE_EVERY_S = 0.0; from uwsim import cli; cli.main()"

    def start(out: str, *options: str) -> subprocess.Popen:
        (folder / out).mkdir(exist_ok=True)
        command = ("render", "scene.toml", "--noise", "0.8%", "--out", f"{out}/frame", *options)
        return subprocess.Popen([sys.executable, "-c", code, *command], stderr=subprocess.PIPE, text=True)

    whole, killed = start("whole"), start("killed", "--checkpoint", "sums.npz")
    deadline = time.monotonic() + 300
    while not (folder / "sums.npz").exists():
        assert killed.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    assert not (folder / "killed/frame").exists(), "ended before it was killed: the test says nothing"
    for process in (start("killed", "--checkpoint", "sums.npz", "--resume"), whole):
        assert process.communicate(timeout=300)[1] == "" and process.returncode == 0
    for file in ("image.png", "frame.exr", "frame.json"):
        assert (folder / "whole/frame" / file).read_bytes() == (folder / "killed/frame" / file).read_bytes()
