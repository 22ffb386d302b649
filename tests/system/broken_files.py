"""Broken datasets, benchmarks, photographs, outputs and command lines."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.system.broken import GENERATE, RENDER, RESTORATION, SCENE, call, changed, dataset, method, picture, put
from uwsim.files import read_json, sha256, write_json


def manifest(folder: Path, change: Callable[[dict], object]) -> None:
    content = read_json(folder / "dataset.json")
    change(content)
    write_json(folder / "dataset.json", content)


def cut(path: Path, length: int) -> None:
    path.write_bytes(path.read_bytes()[:length])


def truncated_but_listed(folder: Path) -> None:
    """Cut an EXR and enter its new checksum: the file itself must be found broken."""
    cut(folder / "frames/000000/frame.exr", 5000)
    checksum = sha256(folder / "frames/000000/frame.exr")
    manifest(folder, lambda content: content["files"].update({"frames/000000/frame.exr": checksum}))


def edited_number(folder: Path) -> None:
    path = folder / "frames/000000/frame.json"
    path.write_text(changed(path.read_text(), '"f_number": 2.8', '"f_number": 4.0'))


def edited_and_listed(folder: Path) -> None:
    path = folder / "frames/000000/frame.json"
    path.write_text(changed(path.read_text(), '"f_number": 2.8', '"f_number": "wide"'))
    manifest(folder, lambda content: content["files"].update({"frames/000000/frame.json": sha256(path)}))


OUTPUTS = [
    call("generate into a full folder", GENERATE, "--out out", "--resume", prepare=lambda folder: put(folder,
         "out/a", "b")),
    call("resume another recipe", ("generate", "recipe.toml", "--out", "data", "--resume"), "--resume data",
         "differs"),
    call("resume what is no dataset", (*GENERATE, "--resume"), "out", "dataset.json",
         prepare=lambda folder: put(folder, "out/a", "b")),
    call("resume a broken dataset", (*GENERATE, "--resume"), "dataset.json", "JSON",
         prepare=lambda folder: put(folder, "out/dataset.json", "{")),
    call("generate below nothing", ("generate", "recipe.toml", "--out", "no/out"), "--out no/out", "does not exist"),
    call("generate over a file", GENERATE, "--out out", "file", prepare=lambda folder: put(folder, "out", "b")),
    call("generate below a file", ("generate", "recipe.toml", "--out", "scene.toml/out"), "scene.toml"),
    call("render samples", (*RENDER, "--samples", "3", "--batches", "2"), "samples", "3", "multiple"),
    call("render one batch", (*RENDER, "--samples", "4", "--batches", "1"), "batches", "1", "2"),
    call("render no samples", (*RENDER, "--samples", "0", "--batches", "0"), "samples", "0"),
    call("render seed", (*RENDER, "--seed", "-1"), "seed", "-1", ">= 0"),
    call("render size", (*RENDER, "--size", "abc"), "--size", "'abc'", "WIDTHxHEIGHT"),
    call("render size zero", (*RENDER, "--size", "0x10"), "--size 0x10", "width_px", "1"),
    call("render samples text", (*RENDER, "--samples", "many"), "--samples", "integer"),
    call("render over a folder", RENDER, "--out out", "exists", prepare=lambda folder: (folder / "out").mkdir()),
    call("render geometry over a folder", (*RENDER, "--geometry-only"), "--out out", "exists",
         prepare=lambda folder: (folder / "out").mkdir()),
    call("render below nothing", ("render", "scene.toml", "--out", "no/out"), "--out no/out", "does not exist"),
    call("render size with K", (*RENDER, "--size", "64x48"), "--size", "K_px", prepare=lambda folder: put(
        folder, "scene.toml", changed(SCENE, "horizontal_fov_deg = 50.0", "K_px = [30, 30, 16, 12]"))),
    call("render size of a broken scene", (*RENDER, "--size", "64x48"), "scene.toml", "rig",
         prepare=lambda folder: put(
        folder, "scene.toml", changed(SCENE, "[rig.camera]", "[rag.camera]"))),
]  # fmt: skip

CHECKS = [
    call("check nothing", ("check", "nothing"), "nothing", "no dataset"),
    call("check a file", ("check", "scene.toml"), "scene.toml", "no dataset"),
    dataset("manifest no JSON", lambda folder: put(folder, "dataset.json", "{]"), "dataset.json", "JSON", "line 1"),
    dataset("manifest a list", lambda folder: put(folder, "dataset.json", "[]"), "dataset.json", "[]", "a table"),
    dataset("manifest key", lambda folder: manifest(folder, lambda c: c.pop("seed")), "dataset.json", "seed",
         "missing"),
    dataset("manifest extra key", lambda folder: manifest(folder, lambda c: c.update(size=3)), "dataset.json",
         "size"),
    dataset("manifest type", lambda folder: manifest(folder, lambda c: c.update(seed="one")), "dataset.json",
         "seed", "whole number"),
    dataset("manifest format", lambda folder: manifest(folder, lambda c: c.update(format=9)), "dataset.json", "9",
         "1"),
    dataset("manifest path", lambda folder: manifest(folder, lambda c: c["files"].update({"../a": "b"})), "'../a'"),
    dataset("manifest no frames", lambda folder: manifest(folder, lambda c: c.update(files={})), "data", "no frames"),
    dataset("unfinished", lambda folder: manifest(folder, lambda c: c.update(complete=False)), "unfinished",
         "--resume"),
    dataset("frame edited", edited_number, "data", "frames/000000/frame.json", "changed"),
    dataset("frame edited and listed", edited_and_listed, "frames/000000/frame.json", "sensor.f_number", "wide"),
    dataset("EXR truncated", lambda folder: cut(folder / "frames/000000/frame.exr", 5000), "frames/000000/frame.exr"),
    dataset("EXR truncated and listed", truncated_but_listed, "frames/000000/frame.exr", "EXR"),
    dataset("image of 0 bytes", lambda folder: cut(folder / "frames/000002/image.png", 0), "frames/000002/image.png"),
    dataset("file deleted", lambda folder: (folder / "frames/000000/image.png").unlink(), "frames/000000/image.png",
         "missing"),
    dataset("frame deleted", lambda folder: shutil.rmtree(folder / "frames/000002"), "frames/000002", "missing"),
    dataset("frames deleted", lambda folder: shutil.rmtree(folder / "frames"), "frames/000000", "missing"),
    dataset("extra file", lambda folder: put(folder, "frames/000000/notes.txt", "a"), "frames/000000/notes.txt",
         "not listed"),
    dataset("left-over frame", lambda folder: put(folder, "frames/000003.partial/image.png", "a"), "000003.partial"),
    dataset("left-over empty frame", lambda folder: (folder / "frames/000003.partial").mkdir(), "000003.partial"),
    dataset("left-over file", lambda folder: put(folder, "frames/000000/.partial-7-frame.exr", "a"),
         ".partial-7-frame.exr"),
    dataset("folder in a frame", lambda folder: put(folder, "frames/000000/more/a", "b"), "frames/000000/more"),
    dataset("empty extra frame", lambda folder: (folder / "frames/000009").mkdir(), "frames/000009"),
]  # fmt: skip

BENCHES = [
    call("bench unknown", ("bench", "resolution", "--dataset", "data"), "'resolution'", "restoration"),
    call("bench broken definition", ("bench", "mine.toml", "--dataset", "data"), "mine.toml", "task", "'sharpness'",
         prepare=lambda folder: put(folder, "mine.toml", 'task = "sharpness"')),
    call("bench no dataset", ("bench", "restoration", "--dataset", "nothing"), "nothing", "no dataset"),
    call("bench unknown algorithm", (*RESTORATION, "--algorithm", "magic"), "'magic'", "clahe"),
    call("bench no such file", (*RESTORATION, "--algorithm", "mine.py"), "mine.py", "does not exist"),
    method("syntax", "def restore(image:\n", "mine.py", "SyntaxError"),
    method("import", "import no_such_package_here\n", "mine.py", "ModuleNotFoundError", "no_such_package_here"),
    method("exits on import", "raise SystemExit(0)\n", "mine.py", "SystemExit"),
    method("raises", "def restore(image):\n    raise RuntimeError('first\\nsecond')\n", "mine", "RuntimeError",
         "first second"),
    method("dtype", "def restore(image):\n    return image / 255\n", "mine", "float64", "uint8"),
    method("shape", "def restore(image):\n    return image[::2].copy()\n", "mine", "(48, 128, 3)", "(96, 128, 3)"),
    method("nothing", "def restore(image):\n    pass\n", "mine", "NoneType"),
    method("no function", "def enhance(image):\n    return image\n", "mine", "restore()"),
    method("needs", "NEEDS = ('truth',)\ndef restore(image, truth):\n    return truth\n", "mine", "truth", "range_m"),
    call("bench no frame", ("bench", "pose", "--dataset", "data"), "data", "visible marker"),
    call("bench broken EXR", RESTORATION, "frames/000000/frame.exr", "EXR",
         prepare=lambda folder: cut(folder / "data/frames/000000/frame.exr", 5000)),
    call("bench broken image", RESTORATION, "frames/000000/image.png", "empty",
         prepare=lambda folder: cut(folder / "data/frames/000000/image.png", 0)),
    call("bench broken frame", RESTORATION, "frames/000000/frame.json", "JSON",
         prepare=lambda folder: put(folder, "data/frames/000000/frame.json", "{")),
    call("bench json below nothing", (*RESTORATION, "--json", "no/result.json"), "no/result.json", "does not exist"),
    call("bench json is a folder", (*RESTORATION, "--json", "data"), "data", "folder"),
]  # fmt: skip

GREY = np.zeros((8, 8), np.uint8)
MOSTLY_WHITE = np.full((64, 64, 3), 255, np.uint8)
MOSTLY_WHITE[:10] = 90
KNOWN = ("--length-px", "4", "--angle-deg", "30")
PHOTOGRAPHS = [
    call("restore unknown method", ("restore", "magic", "a.png", "--out", "out"), "'magic'", "clahe"),
    call("restore missing image", ("restore", "clahe", "nothing.png", "--out", "out"), "nothing.png", "no such"),
    call("restore folder", ("restore", "clahe", "data", "--out", "out"), "data", "no such image"),
    call("restore empty image", ("restore", "clahe", "a.png", "b.png", "--out", "out"), "b.png", "0 bytes",
         prepare=lambda folder: put(folder, "b.png", "")),
    call("restore grey image", ("restore", "clahe", "b.png", "--out", "out"), "b.png", "1 channel", "3",
         prepare=lambda folder: picture(folder, "b.png", GREY)),
    call("restore 16-bit image", ("restore", "clahe", "b.png", "--out", "out"), "b.png", "16-bit", "8-bit",
         prepare=lambda folder: picture(folder, "b.png", np.zeros((8, 8, 3), np.uint16))),
    call("restore image with alpha", ("restore", "clahe", "b.png", "--out", "out"), "b.png", "4 channel", "3",
         prepare=lambda folder: picture(folder, "b.png", np.zeros((8, 8, 4), np.uint8))),
    call("restore text", ("restore", "clahe", "scene.toml", "--out", "out"), "scene.toml", "PNG"),
    call("restore truncated image", ("restore", "clahe", "a.png", "--out", "out"), "a.png",
         prepare=lambda folder: cut(folder / "a.png", 60)),
    call("restore half an image", ("restore", "clahe", "a.png", "--out", "out"), "a.png",
         prepare=lambda folder: cut(folder / "a.png", 3000)),
    call("restore with truth", ("restore", "oracle_inverse", "a.png", "--out", "out"), "oracle_inverse",
         "transmission"),
    call("restore same names", ("restore", "clahe", "a.png", "more/a.png", "--out", "out"), "a.png",
         "different names",
         prepare=lambda folder: picture(folder, "more/a.png", np.zeros((8, 8, 3), np.uint8))),
    call("restore over a file", ("restore", "clahe", "a.png", "--out", "scene.toml"), "scene.toml", "file"),
    call("restore over its input", ("restore", "clahe", "a.png", "--out", "."), "a.png"),
    call("restore below nothing", ("restore", "clahe", "a.png", "--out", "no/out"), "no/out", "does not exist"),
    call("restore no function", ("restore", "mine.py", "a.png", "--out", "out"), "mine", "restore()",
         prepare=lambda folder: put(folder, "mine.py", "pass")),
    call("restore nothing", ("restore", "clahe", "--out", "out"), "'images'"),
    call("deblur unknown method", ("deblur", "magic", "a.png", "--out", "out", *KNOWN), "'magic'", "wiener"),
    call("deblur unknown estimator", ("deblur", "wiener", "a.png", "--out", "out", "--estimator", "magic"), "'magic'",
         "cepstrum_minimum"),
    call("deblur no estimate", ("deblur", "wiener", "b.png", "--out", "out"), "b.png", "constant",
         prepare=lambda folder: picture(folder, "b.png", np.full((64, 64, 3), 90, np.uint8))),
    call("deblur half a blur", ("deblur", "wiener", "a.png", "--out", "out", "--length-px", "4"), "--angle-deg"),
    call("deblur two blurs", ("deblur", "wiener", "a.png", "--out", "out", "--estimator", "none", *KNOWN),
         "--estimator", "--length-px"),
    call("deblur negative", ("deblur", "wiener", "a.png", "--out", "out", "--length-px", "-4", "--angle-deg", "0"),
         "-4"),
    call("deblur not finite", ("deblur", "wiener", "a.png", "--out", "out", "--length-px", "4", "--angle-deg", "nan"),
         "nan", "--angle-deg"),
    call("deblur too long", ("deblur", "mmse", "a.png", "--out", "out", "--length-px", "40", "--angle-deg", "0"),
         "a.png", "40 px", "32"),
    call("deblur with truth", ("deblur", "wiener", "a.png", "--out", "out", "--estimator", "oracle_sharp"),
         "oracle_sharp", "sharp"),
    call("deblur missing image", ("deblur", "wiener", "nothing.png", "--out", "out", *KNOWN), "nothing.png", "no such"),
    call("deblur tiny image", ("deblur", "wiener", "b.png", "--out", "out", *KNOWN), "b.png", "16",
         prepare=lambda folder: picture(folder, "b.png", np.zeros((8, 8, 3), np.uint8))),
    call("deblur constant image", ("deblur", "wiener", "a.png", "b.png", "--out", "out", *KNOWN), "b.png", "constant",
         prepare=lambda folder: picture(folder, "b.png", np.full((64, 64, 3), 90, np.uint8))),
    call("deblur white image", ("deblur", "wiener", "b.png", "--out", "out", *KNOWN), "b.png", "white",
         prepare=lambda folder: picture(folder, "b.png", MOSTLY_WHITE)),
    call("deblur over its input", ("deblur", "wiener", "a.png", "--out", ".", *KNOWN), "a.png"),
    call("deblur below nothing", ("deblur", "wiener", "a.png", "--out", "no/out", *KNOWN), "no/out", "does not exist"),
    call("deblur no function", ("deblur", "mine.py", "a.png", "--out", "out", *KNOWN), "mine", "deblur()",
         prepare=lambda folder: put(folder, "mine.py", "pass")),
    call("report no dataset", ("report", "--dataset", "nothing", "--out", "page.html"), "nothing", "no dataset"),
    call("report below nothing", ("report", "--dataset", "data", "--out", "no/page.html"), "no/page.html"),
    call("report result missing", ("report", "--dataset", "data", "--out", "page.html", "--bench", "r.json"),
         "r.json"),
    call("report no JSON", ("report", "--dataset", "data", "--out", "page.html", "--bench", "scene.toml"),
         "scene.toml",
         "JSON"),
    call("report no result", ("report", "--dataset", "data", "--out", "page.html", "--bench", "data/dataset.json"),
         "dataset.json", "benchmark result"),
    call("report half a result", ("report", "--dataset", "data", "--out", "page.html", "--bench", "r.json"), "r.json",
         "benchmark result", prepare=lambda folder: put(
             folder, "r.json", '{"benchmark": "restoration", "provenance": 3, "records": []}')),
    call("report list", ("report", "--dataset", "data", "--out", "page.html", "--bench", "r.json"), "r.json",
         "benchmark result", prepare=lambda folder: put(folder, "r.json", "[]")),
    call("report broken EXR", ("report", "--dataset", "data", "--out", "page.html"), "frames/000000/frame.exr",
         prepare=lambda folder: cut(folder / "data/frames/000000/frame.exr", 5000)),
    call("schema unknown", ("schema", "lamp"), "'lamp'", "scene, recipe, benchmark, frame"),
    call("schema below nothing", ("schema", "scene", "--out", "no/scene.json"), "no/scene.json", "does not exist"),
    call("doctor below nothing", ("doctor", "--json", "no/doctor.json"), "no/doctor.json", "does not exist"),
    call("demo over a file", ("demo", "--out", "scene.toml"), "scene.toml", "file"),
    call("unknown command", ("paint",), "paint"),
    call("unknown option", (*RENDER, "--colour"), "--colour"),
    call("missing argument", ("render", "--out", "out"), "'scene'"),
    call("missing option", ("render", "scene.toml"), "--out"),
    call("option without value", ("render", "scene.toml", "--out"), "--out"),
]  # fmt: skip
