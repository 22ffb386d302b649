"""The rules that end a render, on synthetic noise of known variance; sums on disk; what is asked for and refused."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from uwsim.dataset import info, make
from uwsim.render import accumulate, memory, stopping
from uwsim.render.accumulate import Sums
from uwsim.render.checkpoint import Checkpoint
from uwsim.render.stopping import Noise, Until

SHAPE = (40, 56, 3)
REGION_PIXELS = 5 * 7


class Stream:
    """Batch means of independent normal pixels, summed as a render's are."""

    def __init__(self, *, mean=1.0, std=0.1, seed=0):
        self.mean, self.std = np.broadcast_to(mean, SHAPE), np.broadcast_to(std, SHAPE)
        self.rng = np.random.default_rng(seed)
        regions = stopping.region_means(self.mean)
        self.sums = Sums(0, *(np.zeros(s) for s in ((1, *SHAPE), (1, *SHAPE), regions.shape, regions.shape)))

    def add(self, batches: int) -> Sums:
        for _ in range(batches):
            image = self.mean + self.std * self.rng.standard_normal(SHAPE)
            regions = stopping.region_means(image)
            self.sums.sums += image
            self.sums.squares += image**2
            self.sums.region_sums += regions
            self.sums.region_squares += regions**2
            self.sums.batches += 1
        return self.sums

    def noise(self, *, sensor_noise=1.0, dark=0.0) -> Noise:
        return stopping.measure(
            region_sums=self.sums.region_sums, region_squares=self.sums.region_squares, batches=self.sums.batches,
            standard_error=self.sums.standard_error(), sensor_noise=np.broadcast_to(sensor_noise, SHAPE),
            dark=np.full(3, dark),
        )  # fmt: skip


def test_region_means_of_any_size():
    rng = np.random.default_rng(1)
    for height, width in ((40, 56), (41, 59), (8, 8), (5, 100), (1, 1)):
        image = rng.random((height, width, 2))
        found = stopping.region_means(image)
        assert found.shape == (min(height, 8), min(width, 8), 2)
        rows = np.append(np.arange(found.shape[0]) * height // found.shape[0], height)
        columns = np.append(np.arange(found.shape[1]) * width // found.shape[1], width)
        for i, j in np.ndindex(found.shape[:2]):
            part = image[rows[i] : rows[i + 1], columns[j] : columns[j + 1]]
            assert found[i, j] == pytest.approx(part.mean(axis=(0, 1)), rel=1e-12)


def test_region_error_of_known_noise():
    """The 95th percentile over 192 regions of estimates that scatter by 1 / sqrt(2 (n - 1)) about the true error."""
    stream = Stream(mean=2.0, std=0.3)
    stream.add(200)
    true = 0.3 / math.sqrt(REGION_PIXELS * 200) / 2.0
    assert stream.noise().region_error_p95 == pytest.approx(true * (1 + 1.645 / math.sqrt(2 * 199)), rel=0.03)
    # control: a relative error of pixels instead of regions would be sqrt(35) as large
    assert stream.noise().region_error_p95 < true * 1.3


def test_dark_regions_do_not_dominate():
    mean = np.full(SHAPE, 1.0)
    mean[:20] = 1e-3
    stream = Stream(mean=mean, std=0.01 * np.sqrt(mean))
    stream.add(100)
    plain, with_floor = stream.noise().region_error_p95, stream.noise(dark=0.1).region_error_p95
    bright = 0.01 / math.sqrt(REGION_PIXELS * 100)
    assert plain > 20 * bright  # control: without the floor the dark half decides
    assert with_floor == pytest.approx(bright * (1 + 1.645 / math.sqrt(2 * 99)), rel=0.1)


def test_black_without_sensor_noise_has_no_error():
    stream = Stream(mean=0.0, std=0.0)
    stream.add(8)
    found = stream.noise(sensor_noise=0.0)
    assert (found.region_error_p95, found.pixel_ratio_p95, found.pixel_share_within) == (0, 0, 1)


def test_pixel_ratio_is_a_local_root_mean_square():
    error = np.zeros((4, 5, 3))
    error[1, 1, 0] = 3.0
    ratio = stopping.pixel_ratio(error, np.full((4, 5, 3), 2.0))
    assert ratio[1, 1, 0] == pytest.approx(1.5 / 3)  # 9 pixels
    assert ratio[0, 0, 0] == pytest.approx(1.5 / 2)  # 4 pixels
    assert ratio[0, 2, 0] == pytest.approx(1.5 / math.sqrt(6))
    assert not ratio[..., 1:].any() and not ratio[3].any() and not ratio[:, 3:].any()
    assert np.all(np.isinf(stopping.pixel_ratio(np.ones((2, 2, 3)), np.zeros((2, 2, 3)))))


def test_share_within_counts_pixels_whose_every_band_is_within():
    ratio = np.full((10, 10, 3), 0.5)
    assert stopping.share_within(ratio) == 1
    ratio[:2, :, 1] = 0.51
    assert stopping.share_within(ratio) == pytest.approx(0.8)


def _stopped_at(until: Until, stream: Stream, **sensor) -> int:
    while True:
        stream.add(stopping.next_check(stream.sums.batches + 1) - stream.sums.batches)
        if until.holds(stream.noise(**sensor)):
            return stream.sums.batches


@pytest.mark.parametrize("seed", range(4))
def test_the_region_rule_stops_at_the_number_of_samples_it_takes(seed):
    """Not before the true error is down, and not after twice the samples: checks a quarter apart, percentile 1.2."""
    region = 0.0015
    needed = (0.1 / math.sqrt(REGION_PIXELS) / region) ** 2  # 127 batches
    stopped = _stopped_at(Until(region=region), Stream(seed=seed), sensor_noise=100.0)
    assert needed <= stopped <= 1.25 * needed * (1 + 1.645 / math.sqrt(2 * needed)) ** 2 * 1.05


@pytest.mark.parametrize("seed", range(4))
def test_the_pixel_rule_stops_at_the_number_of_samples_it_takes(seed):
    """The true ratio is 0.5 after 60 batches; the largest of three bands over nine pixels scatters a little above."""
    sensor_noise = 0.1 / math.sqrt(60) / 0.5
    stopped = _stopped_at(Until(region=0.5), Stream(seed=seed), sensor_noise=sensor_noise)
    assert 60 <= stopped <= 1.25 * 60 * 1.25
    # control: single pixels would keep on for a good deal longer
    error = 0.1 / math.sqrt(stopped) * np.sqrt(np.random.default_rng(seed).chisquare(stopped - 1, SHAPE) / stopped)
    assert np.mean((error / sensor_noise).max(axis=-1) <= 0.5) < 0.95


def test_checks_are_a_quarter_apart():
    checks = [8]
    while checks[-1] < 1000:
        checks.append(stopping.next_check(checks[-1] + 1))
    assert checks[:8] == [8, 10, 13, 17, 22, 28, 35, 44]
    assert all(1.19 < b / a <= 1.31 for a, b in zip(checks, checks[1:], strict=False))
    assert stopping.next_check(1) == 8 and stopping.next_check(44) == 44


def noise(batches=8, region=0.02, ratio=0.4, share=0.99) -> Noise:
    return Noise(batches=batches, region_error_p95=region, pixel_ratio_p95=ratio, pixel_share_within=share)


def test_both_rules_must_hold():
    rule = Until(region=0.02)
    assert rule.holds(noise())
    assert not rule.holds(noise(region=0.0201))
    assert not rule.holds(noise(share=0.949))
    assert not Until(batches=9).holds(noise())


def test_without_pixels_the_region_rule_alone_ends_a_render():
    rule = Until(region=0.02, pixels=False)
    assert rule.holds(noise(share=0.1))
    assert not rule.holds(noise(region=0.021))
    poor = noise(batches=8, region=0.04, ratio=50.0, share=0.0)
    assert 32 <= rule.expected_batches(poor) < 45  # four times the samples halve the error
    assert Until(region=0.02).expected_batches(poor) > 1000


@pytest.mark.parametrize("pixels, rule_met, met", [(True, False, False), (False, None, True)])
def test_a_rule_that_was_not_asked_for_is_not_held_against_a_frame(pixels, rule_met, met):
    """Expected: frame.json states null for it, and the frame meets its rules. Control: the same noise with it asked."""
    ended = SimpleNamespace(noise=noise(share=0.1), samples_per_pixel=128, by="noise")
    stated = make._noise(SimpleNamespace(ended={"radiance": ended}), Until(region=0.02, pixels=pixels))["noise"]
    assert (stated["pictures"]["radiance"]["pixel_rule_met"], stated["met"]) == (rule_met, met)
    found = info.Noise.model_validate(stated)
    assert found.met == met
    with pytest.raises(ValueError, match="noise.met"):
        info.Noise.model_validate(stated | {"met": not met})


def test_time_to_go_follows_the_square_root_law():
    rule = Until(region=0.01)
    assert rule.expected_batches(None) == 8
    assert rule.expected_batches(noise(region=0.02)) == stopping.next_check(32)
    assert rule.expected_batches(noise(region=0.005, ratio=5.0, share=0.1)) == stopping.next_check(800)
    assert Until(region=0.01, batches=20).expected_batches(noise(region=0.2)) == 20
    assert Until(time_s=1.0).expected_batches(None) is None
    assert Until(batches=7).expected_batches(None) == 7


@pytest.mark.parametrize(
    ("values", "fragment"),
    [
        ({}, "nothing that ends the render"),
        ({"batches": 1}, "at least 2"),
        ({"batches": 4, "samples_per_batch": 0}, "at least 1"),
        ({"region": 0.0}, "0.0001 to 0.5"),
        ({"region": float("nan")}, "0.0001 to 0.5"),
        ({"time_s": 0.0}, "above 0"),
        ({"time_s": float("inf")}, "above 0"),
    ],
)
def test_impossible_ends_are_refused(values, fragment):
    with pytest.raises(ValueError, match=fragment):
        Until(**values)


def test_samples_or_a_rule():
    assert stopping.until(16, 4, None) == Until(samples_per_batch=4, batches=4)
    assert stopping.until(None, None, Until(region=0.1)) == Until(region=0.1)
    for given in ((None, None, None), (16, 4, Until(region=0.1)), (16, None, None), (None, 4, None)):
        with pytest.raises(ValueError, match="give samples_per_pixel with batches, or a noise rule"):
            stopping.until(*given)
    for given in ((3, 2), (4, 1), (0, 0)):
        with pytest.raises(ValueError, match="multiple"):
            stopping.until(*given, None)


def test_texts_of_the_command_line():
    assert stopping.share_from_text("1%") == 0.01 == stopping.share_from_text("0.01")
    assert stopping.share_from_text("2.5 %") == 0.025
    for text in ("1", "0%", "60%", "-1%", "", "one", "1%%"):
        with pytest.raises(ValueError, match="--noise"):
            stopping.share_from_text(text)
    assert [stopping.seconds_from_text(text) for text in ("60s", "5m", "1.5h")] == [60, 300, 5400]
    for text in ("60", "0s", "-3m", "", "5 minutes"):
        with pytest.raises(ValueError, match="--time"):
            stopping.seconds_from_text(text)


def test_max_samples_are_whole_batches():
    assert stopping.most_batches(96, 4) == 24
    with pytest.raises(ValueError, match="a multiple of samples_per_batch = 4, at least 32"):
        stopping.most_batches(28, 4)
    assert stopping.most_batches(160) == 10
    for samples in (100, 64, 0, -16):
        with pytest.raises(ValueError, match="max_samples"):
            stopping.most_batches(samples)


@pytest.mark.parametrize("most_row", [100, 1 << 24])
@pytest.mark.parametrize(("width", "height", "samples"), [(64, 48, 16), (9, 3, 40), (200, 2, 7)])
def test_launches_cover_every_sample_of_every_pixel_once(monkeypatch, width, height, samples, most_row):
    """Whole rows, or, where one row has too many samples, parts of a row's samples with seeds of their own."""
    monkeypatch.setattr(accumulate, "_ROW_SAMPLES", most_row)
    monkeypatch.setattr(accumulate, "_LAUNCH_SAMPLES", 4000 if most_row > 100 else 100)
    view = type("View", (), {"width_px": width, "height_px": height})
    launches = accumulate._launches(view, samples)
    covered = np.zeros(height, int)
    for top, rows, _, share in launches:
        covered[top : top + rows] += share
        assert rows * width * share <= max(accumulate._LAUNCH_SAMPLES, 2 * width)
    assert np.all(covered == samples)
    assert len({accumulate._launch_seed(1, 2, top, part) for top, _, part, _ in launches}) == len(launches)


def test_an_image_that_does_not_fit_is_refused_with_the_estimate(monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 10**9)
    memory.require_memory(width_px=320, height_px=240)
    memory.require_memory(width_px=500, height_px=500)
    with pytest.raises(ValueError, match=r"500 x 500 pixels need about 1\.1 GB"):
        memory.require_memory(width_px=500, height_px=500, denoise=True)
    with pytest.raises(ValueError, match=r"image size: 16384 x 16384 pixels need about \d+\.\d GB .* 1.0 GB available"):
        memory.require_memory(width_px=16384, height_px=16384)
    monkeypatch.setattr(memory, "available_bytes", lambda: None)
    memory.require_memory(width_px=16384, height_px=16384)


def test_memory_of_machine_and_group(tmp_path, monkeypatch):
    (tmp_path / "limit").write_text("5000\n")
    (tmp_path / "used").write_text("3000\n")
    (tmp_path / "memory.stat").write_text("anon 1\ncache 500\n")
    monkeypatch.setattr(memory, "_CGROUPS", ((tmp_path, "limit", "used", "cache"),))
    assert memory.available_bytes() == 2500
    (tmp_path / "limit").write_text("max\n")
    assert memory.available_bytes() == memory._machine_bytes()


NPY = b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '<f8', 'fortran_order': False, 'shape': (0,), }".ljust(117) + b"\n"
IDENTITY = {"scene": "abc", "seed": 1, "samples per batch": 16}


def test_a_checkpoint_returns_the_same_sums(tmp_path):
    kept = Checkpoint(tmp_path / "c.npz", identity=IDENTITY, resume=False)
    sums = Stream().add(9)
    kept.store("radiance", sums, now=False)
    assert not (tmp_path / "c.npz").exists()  # the last time is not long ago
    kept.store("radiance", sums, now=True)
    kept.store("sharp", Stream(seed=2).add(3), now=True)
    assert [path.name for path in tmp_path.iterdir()] == ["c.npz"]
    found = Checkpoint(tmp_path / "c.npz", identity=dict(IDENTITY), resume=True)
    assert found.sums("water_free") is None and found.sums("sharp").batches == 3
    again = found.sums("radiance")
    assert again.batches == 9
    for part in ("sums", "squares", "region_sums", "region_squares"):
        assert np.array_equal(getattr(again, part), getattr(sums, part))


def test_a_checkpoint_is_for_one_scene_seed_and_size(tmp_path):
    path = tmp_path / "c.npz"
    Checkpoint(path, identity=IDENTITY, resume=False).store("radiance", Stream().add(2), now=True)
    for key, value in (("scene", "abd"), ("seed", 2), ("samples per batch", 8)):
        with pytest.raises(ValueError, match=f"holds another {key}, got .* allowed: .*{value}"):
            Checkpoint(path, identity=IDENTITY | {key: value}, resume=True)
    with pytest.raises(ValueError, match="exists already"):
        Checkpoint(path, identity=IDENTITY, resume=False)
    with pytest.raises(ValueError, match="no such file"):
        Checkpoint(tmp_path / "d.npz", identity=IDENTITY, resume=True)
    with pytest.raises(ValueError, match="folder"):
        Checkpoint(tmp_path / "no" / "d.npz", identity=IDENTITY, resume=False)


@pytest.mark.parametrize("content", [b"", b"nothing", b"PK\x03\x04 cut", NPY])
def test_a_broken_checkpoint_is_refused_in_one_line(tmp_path, content):
    (tmp_path / "c.npz").write_bytes(content)
    with pytest.raises(ValueError, match="not readable as a checkpoint") as caught:
        Checkpoint(tmp_path / "c.npz", identity=IDENTITY, resume=True)
    assert "\n" not in str(caught.value)


def test_a_cut_checkpoint_is_refused(tmp_path):
    path = tmp_path / "c.npz"
    Checkpoint(path, identity=IDENTITY, resume=False).store("radiance", Stream().add(2), now=True)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(ValueError, match="not readable as a checkpoint"):
        Checkpoint(path, identity=IDENTITY, resume=True)
