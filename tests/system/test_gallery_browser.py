"""The gallery in a real browser, from the disk: sheet, filters, frames, layers, drawings; nothing foreign."""

import json
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import unquote

import pytest

from tests.system.chromium import find, needs_browser, open_page, reload_page, synthetic_dataset, wait_for


def put_in_motion(path: Path) -> None:
    """Have the camera move to its right by 10 mm during the exposure."""
    info = json.loads(path.read_text())
    camera = info["camera"]
    camera["times_s"] = [-0.005, 0.0, 0.005]
    camera["world_from_camera_through_exposure"] = [
        [[*row[:3], row[3] + (shift_m if index == 0 else 0)] for index, row in enumerate(camera["world_from_camera"])]
        for shift_m in (-0.005, 0.0, 0.005)
    ]
    path.write_text(json.dumps(info))


def command(*arguments: object) -> subprocess.CompletedProcess:
    called = [sys.executable, "-m", "uwsim.cli", *map(str, arguments)]
    return subprocess.run(called, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("gallery")
    synthetic_dataset(folder / "data set")
    put_in_motion(folder / "data set/frames/000002/frame.json")
    answer = command("gallery", folder / "data set", "--out", folder / "out #1")  # names that an address must quote
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == f"open {folder / 'out #1' / 'index.html'}: 4 frames, 4 previews made\n"
    return folder / "out #1" / "index.html"


def test_the_command_refuses_in_one_line(tmp_path):
    answer = command("gallery", tmp_path)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert answer.stderr == f"uwsim: {tmp_path}: no dataset here (dataset.json is missing)\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")
def test_a_killed_run_leaves_no_process_behind_and_the_next_goes_on(tmp_path):
    synthetic_dataset(tmp_path / "data")
    arguments = ["gallery", tmp_path / "data", "--out", tmp_path / "out", "--workers", "2"]
    running = subprocess.Popen([sys.executable, "-m", "uwsim.cli", *map(str, arguments)])
    # killed as soon as a worker has begun to write
    assert within(60, lambda: any((tmp_path / "out/frames").glob("0*")))
    workers = [pid for pid in children(running.pid) if "spawn_main" in command_line(pid)]
    assert workers
    running.kill()
    running.wait()
    assert within(20, lambda: not any("spawn_main" in command_line(pid) for pid in workers))
    assert not (tmp_path / "out/index.html").exists()
    answer = command(*arguments)
    assert answer.returncode == 0, answer.stderr
    assert not list((tmp_path / "out").rglob("*.partial*"))
    assert sorted(path.name for path in (tmp_path / "out/frames").iterdir()) == ["000000", "000001", "000002", "000003"]


def children(parent: int) -> list[str]:
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()  # a name may hold blanks
        except OSError:  # ended meanwhile
            continue
        if fields[1] == str(parent):
            found.append(path.parent.name)
    return found


def command_line(pid: str) -> str:
    path = Path("/proc") / pid / "cmdline"
    return path.read_text().replace("\0", " ") if path.exists() else ""


def within(limit_s: float, true) -> bool:
    """Whether something becomes true within a time."""
    end_s = time.monotonic() + limit_s
    while not true():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.02)
    return True


def names(browser) -> list[str]:
    return [card.find_element("css selector", "b").text for card in find(browser, ".card")]


def choose(browser, name: str, text: str) -> None:
    from selenium.webdriver.support.ui import Select

    control = Select(find(browser, f"select[name={name}]")[0])
    control.select_by_visible_text(next(one.text for one in control.options if one.text.startswith(text)))


def open_frame(browser, name: str) -> None:
    next(card for card in find(browser, ".card") if name in card.text).click()
    wait_for(browser, f"document.querySelector('#frame h2')?.textContent === 'Frame {name}'")


def picture(browser) -> str:
    """Return the file of the layer shown, once it has come."""
    wait_for(browser, "(i => i && i.complete && i.naturalWidth)(document.querySelector('.stage img'))")
    return find(browser, ".stage img")[0].get_attribute("src").rpartition("/")[2]


@needs_browser
def test_the_sheet_shows_every_frame_and_loads_nothing_foreign(opened, page):
    assert opened.title == "uwsim gallery: synthetic"
    assert names(opened) == ["000000", "000001", "000002", "000003"]
    wait_for(opened, "[...document.images].every(i => i.complete && i.naturalWidth)")
    assert all(image.get_attribute("loading") == "lazy" for image in find(opened, ".card img"))
    open_frame(opened, "000002")
    picture(opened)
    assert opened.get_log("browser") == []
    messages = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    sent = [one["params"]["request"]["url"] for one in messages if one["method"] == "Network.requestWillBeSent"]
    asked = [url.partition("#")[0] for url in sent if not url.startswith("data:")]
    assert all(unquote(url).startswith(f"file://{page.parent}/") for url in asked)
    assert [url.rpartition("/frames/")[2] for url in asked if url.endswith("/frame.js")][-1:] == ["000002/frame.js"]
    assert not any("000003/frame.js" in url for url in asked)  # only what is opened


@needs_browser
def test_filters_choose_and_count_and_stand_in_the_address(opened):
    choose(opened, "turbidity", "c = 0.6 /m (1)")
    assert names(opened) == ["000001"]
    assert find(opened, "#count")[0].text == "1 of 4 frames"
    # what would leave nothing cannot be chosen
    (moving,) = (one for one in find(opened, "select[name=markers] option") if one.text.startswith("seen"))
    assert moving.text == "seen (0)"
    assert not moving.is_enabled()
    reload_page(opened)
    assert names(opened) == ["000001"]
    choose(opened, "turbidity", "all")
    choose(opened, "scene", "synthetic (4)")
    choose(opened, "markers", "seen")
    assert names(opened) == ["000003"]
    choose(opened, "markers", "all")
    choose(opened, "sort", "turbidity")
    assert names(opened) == ["000000", "000002", "000003", "000001"]
    choose(opened, "view", "without water")
    assert find(opened, ".card img")[0].get_attribute("src").endswith("thumb_water_free.webp")
    find(opened, "input[name=name]")[0].send_keys("03")
    assert names(opened) == ["000003"]


@needs_browser
def test_every_layer_can_be_shown(opened):
    open_frame(opened, "000002")
    assert picture(opened) == "image.webp"
    keys = [one.get_attribute("value") for one in find(opened, "input[name=layer]")]
    assert set(keys) == {
        "image", "radiance", "sharp", "water_free", "direct", "forward_scatter", "backscatter", "transmission",
        "standard_error", "z_depth", "range", "normal", "albedo", "instance", "flow",
    }  # fmt: skip
    for key in keys:
        find(opened, f"input[name=layer][value={key}]")[0].click()
        assert picture(opened) == f"{key}.webp"
        assert "null" not in find(opened, ".stage")[0].text
    assert find(opened, ".stage .wheel")  # the last is the flow
    find(opened, "input[value=range]")[0].click()
    assert find(opened, ".stage .bar")[0].text.split("\n")[0].endswith(" m")
    reload_page(opened)  # the layer stands in the address
    assert picture(opened) == "range.webp"
    assert opened.get_log("browser") == []


@needs_browser
def test_frames_follow_each_other_by_link_and_key_and_lead_back_to_the_sheet(opened):
    from selenium.webdriver import Keys

    choose(opened, "turbidity", "c = 0.2 /m")
    open_frame(opened, "000000")
    find(opened, "input[value=backscatter]")[0].click()
    find(opened, "a[rel=next]")[0].click()
    wait_for(opened, "document.querySelector('#frame h2').textContent === 'Frame 000002'")  # 000001 is not chosen
    assert picture(opened) == "backscatter.webp"
    find(opened, "body")[0].send_keys(Keys.ARROW_RIGHT)
    wait_for(opened, "document.querySelector('#frame h2').textContent === 'Frame 000003'")
    assert not find(opened, "a[rel=next]")
    find(opened, "body")[0].send_keys(Keys.ESCAPE)
    wait_for(opened, "document.getElementById('frame').hidden")
    assert names(opened) == ["000000", "000002", "000003"]
    opened.back()
    wait_for(opened, "!document.getElementById('frame').hidden")


@needs_browser
def test_poses_are_drawn_where_they_are_and_can_be_taken_away(opened):
    open_frame(opened, "000003")
    picture(opened)
    assert len(find(opened, ".overlay .marker")) == 2
    # the outline of marker 3 lies where its picture is: its corner in pixels of the page
    spot = "(m => { const p = document.querySelector('.marker[data-id=\"3\"] .first').getBoundingClientRect();"
    spot += " const i = document.querySelector('.stage img').getBoundingClientRect();"
    spot += " return [(p.x + p.width / 2 - i.x) / i.width * 128, (p.y + p.height / 2 - i.y) / i.height * 96]; })()"
    x, y = opened.execute_script(f"return {spot}")
    frame = opened.execute_script("return received.get('000003')")
    marker = next(one for one in frame["markers"] if one["id"] == 3)
    assert [x, y] == pytest.approx(marker["corners"][0], abs=0.15)
    assert find(opened, ".overlay [data-instance='2'] .x")
    find(opened, "input[value=markers]")[0].click()
    assert not find(opened, ".overlay .marker")
    find(opened, "input[value=axes]")[0].click()
    assert not find(opened, ".overlay .body")
    assert [row.text.split()[0] for row in find(opened, ".bodies tbody tr")] == ["wall", "board"]


@needs_browser
def test_motion_is_drawn_as_paths_and_as_a_kernel(opened):
    open_frame(opened, "000002")
    picture(opened)
    assert len(find(opened, ".overlay .way")) == 63
    find(opened, "input[value=motion]")[0].click()
    assert not find(opened, ".overlay .way")
    assert len(find(opened, "svg.kernel .dot")) == 17
    # f x shift / depth at the centre: the point goes to the left by about 1 px
    start, end = opened.execute_script("return (k => [k.path[0], k.path[16]])(received.get('000002').kernel)")
    depth_m = 0.9 + 0.7 * 63.5 / 127
    assert [end[0] - start[0], end[1] - start[1]] == pytest.approx([-120 * 0.01 / depth_m, 0], abs=0.02)
    assert f"{abs(end[0] - start[0]):.2f}"[:3] in find(opened, ".blur figcaption")[0].text
    find(opened, "input[value=motion]")[0].click()


@needs_browser
def test_the_json_of_a_frame_opens(opened):
    open_frame(opened, "000001")
    summary = next(one for one in find(opened, ".tree summary") if one.text.startswith("camera"))
    assert "K [3]" not in find(opened, ".tree")[0].text
    summary.click()
    wait_for(opened, "document.querySelector('.tree').innerText.includes('K [3]')")


@needs_browser
def test_a_preview_that_is_gone_is_said_to_be(opened, page):
    folder = page.parent / "frames" / "000001"
    folder.rename(folder.with_name("elsewhere"))
    try:
        open_page(opened, f"{page.as_uri()}#frame=000001")
        wait_for(opened, "document.querySelector('#frame .missing')?.textContent.includes('000001')")
    finally:
        folder.with_name("elsewhere").rename(folder)


@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", [None, "000002", "000003"])
def test_a_narrow_screen_does_not_scroll_sideways(opened, page, scheme, name):
    media = [{"name": "prefers-color-scheme", "value": scheme}]
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": media})
    metrics = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    if name:
        open_page(opened, f"{page.as_uri()}#frame={name}&layer=range")
        picture(opened)
        opened.execute_script("document.querySelectorAll('details').forEach(d => d.open = true)")
    assert opened.execute_script("return document.documentElement.scrollWidth") == 390
    ink, paper = opened.execute_script("const s = getComputedStyle(document.body); return [s.color, s.backgroundColor]")
    brightness = [sum(map(int, colour[4:-1].split(","))) for colour in (ink, paper)]
    assert (brightness[0] < brightness[1]) == (scheme == "light")
