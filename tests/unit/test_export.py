"""Exports for learning (COCO, pairs, WebDataset), splits by scene, and what all exports share."""

import csv
import io
import json
import shutil
import tarfile

import numpy as np
import pytest

from tests.unit import synthetic
from uwsim import discovery
from uwsim.bench.restoration import reference
from uwsim.dataset import store
from uwsim.dataset.frame import BUFFERS
from uwsim.export import formats
from uwsim.export.formats.coco import run_lengths
from uwsim.export.run import export
from uwsim.export.splits import frame_splits, shares_from_text
from uwsim.files import sha256
from uwsim.images import read_srgb

QUIET = {"shares": None, "progress": lambda *_: None}
NAMES = ["bop", "coco", "euroc", "pairs", "tum", "webdataset"]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("export") / "data")


def of_scenes(folder, scenes: list[str], groups: list[str] | None = None) -> store.Dataset:
    """Write frames that differ in their scene (and group) alone."""
    made = synthetic.write_dataset(folder / "one", (0,))
    target = folder / "data"
    for number, scene in enumerate(scenes):
        name = f"{number:06d}"
        shutil.copytree(made.folder / "frames" / "000000", target / "frames" / name)
        path = target / "frames" / name / "frame.json"
        info = json.loads(path.read_text()) | {"name": name, "frame": number, "scene": scene}
        path.write_text(json.dumps(info | {"group": groups[number] if groups else "synthetic"}))
    store.write_manifest(target, made.manifest | {"files": store.checksums(target)})
    return store.open(target)


def decoded(segmentation: dict) -> np.ndarray:
    """Return the mask of uncompressed run lengths, as cocodataset.org describes them."""
    height, width = segmentation["size"]
    values = np.repeat(np.arange(len(segmentation["counts"])) % 2, segmentation["counts"])
    return values.reshape(width, height).T.astype(bool)


@pytest.mark.parametrize(
    ("mask", "counts"),
    [
        ([[0, 0], [0, 0]], [4]),
        ([[1, 1], [1, 1]], [0, 4]),
        ([[0, 1], [1, 0]], [1, 2, 1]),  # down the columns
        ([[1, 0], [0, 0]], [0, 1, 3]),
    ],
)
def test_run_lengths(mask, counts):
    assert run_lengths(np.array(mask)) == counts
    assert np.array_equal(decoded({"size": [2, 2], "counts": counts}), np.array(mask, bool))


def test_coco_masks_boxes_and_categories(dataset, tmp_path):
    assert export(dataset.folder, tmp_path / "coco", format="coco", **QUIET) == "4 images, 8 instances of 2 categories"
    content = json.loads((tmp_path / "coco/annotations/instances_train.json").read_text())
    kinds = {entry["id"]: entry["name"] for entry in content["categories"]}
    assert [entry["id"] for entry in content["annotations"]] == list(range(1, 9))
    for entry in content["images"]:
        frame = dataset.frame(f"{entry['id']:06d}")
        assert np.array_equal(read_srgb(tmp_path / "coco/train" / entry["file_name"]), frame.image)
        own = [one for one in content["annotations"] if one["image_id"] == entry["id"]]
        assert {one["body"] for one in own} == {"wall", "board"}
        for one in own:
            body = next(body for body in frame.info.bodies if body.name == one["body"])
            mask = frame.buffer("instance") == body.instance
            assert kinds[one["category_id"]] == body.kind and one["area"] == mask.sum()
            assert np.array_equal(decoded(one["segmentation"]), mask)
            x, y, width, height = one["bbox"]
            assert mask[y : y + height, x : x + width].sum() == mask.sum()
            assert mask[y].any() and mask[:, x].any() and mask[y + height - 1].any() and mask[:, x + width - 1].any()


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
def test_pycocotools_reads_the_same(dataset, tmp_path, capsys):
    coco = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    export(dataset.folder, tmp_path / "coco", format="coco", **QUIET)
    loaded = coco.COCO(str(tmp_path / "coco/annotations/instances_train.json"))
    from pycocotools import mask as masks

    for annotation in loaded.loadAnns(loaded.getAnnIds()):
        frame = dataset.frame(f"{annotation['image_id']:06d}")
        body = next(body for body in frame.info.bodies if body.name == annotation["body"])
        assert np.array_equal(loaded.annToMask(annotation).astype(bool), frame.buffer("instance") == body.instance)
        packed = loaded.annToRLE(annotation)
        assert masks.area(packed) == annotation["area"]
        assert masks.toBbox(packed).tolist() == annotation["bbox"]


def test_pairs_are_the_picture_and_its_twin(dataset, tmp_path):
    assert export(dataset.folder, tmp_path / "pairs", format="pairs", **QUIET) == "4 pairs"
    root = tmp_path / "pairs/train"
    assert {path.name for path in root.iterdir()} == {"raw-4", "reference-4", "pairs.csv"}
    with (root / "pairs.csv").open() as stream:
        rows = {row["name"]: row for row in csv.DictReader(stream)}
    for frame in dataset.frames:
        assert np.array_equal(read_srgb(root / f"raw-4/{frame.name}.png"), frame.image)
        twin = read_srgb(root / f"reference-4/{frame.name}.png")
        assert np.array_equal(twin, reference(frame)) and not np.array_equal(twin, frame.image)
        assert rows[frame.name]["in_motion"] == str(int(frame.info.blur is not None))
        green = frame.info.water.bands.attenuation_per_m[1]
        assert float(rows[frame.name]["attenuation_g_per_m"]) == pytest.approx(green, rel=1e-5)


def test_webdataset_holds_every_truth_image_bit_by_bit(dataset, tmp_path):
    export(dataset.folder, tmp_path / "shards", format="webdataset", **QUIET)
    with tarfile.open(tmp_path / "shards/train-000000.tar") as tar:
        members = {member.name: tar.extractfile(member).read() for member in tar}
        assert {(m.mtime, m.uid, m.gid, m.uname, m.mode) for m in tar.getmembers()} == {(0, 0, 0, "", 0o644)}
    assert len(members) == 4 * len(dataset)
    for frame in dataset.frames:
        for name in ("image.png", "frame.json"):
            assert members[f"{frame.name}.{name}"] == (frame.folder / name).read_bytes()
        truth = np.load(io.BytesIO(members[f"{frame.name}.truth.npz"]))
        assert set(truth) == set(frame.buffer_names)
        for name in truth:
            assert np.array_equal(truth[name], frame.buffer(name))
            assert truth[name].dtype == {"half": np.float16, "float": np.float32, "uint": np.uint32}[BUFFERS[name][1]]


def test_webdataset_bytes_depend_on_the_dataset_alone(dataset, tmp_path):
    for name in "ab":
        export(dataset.folder, tmp_path / name, format="webdataset", **QUIET)
    assert sha256(tmp_path / "a/train-000000.tar") == sha256(tmp_path / "b/train-000000.tar")


def test_shards_end_before_they_are_too_large(dataset, tmp_path, monkeypatch):
    from uwsim.export.formats import webdataset

    size = sum(map(len, webdataset.sample(dataset.frame("000000")).values()))
    monkeypatch.setattr(webdataset, "MOST_BYTES", int(2.5 * size))
    assert export(dataset.folder, tmp_path / "shards", format="webdataset", **QUIET) == "4 samples in 2 shards"
    names = []
    for path in sorted((tmp_path / "shards").glob("*.tar")):
        with tarfile.open(path) as tar:
            names.append(sorted({name.partition(".")[0] for name in tar.getnames()}))
    assert sum(names, []) == list(dataset.frame_names) and max(map(len, names)) == 2


# the library leaves its files to the garbage collector
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_webdataset_library_reads_it(dataset, tmp_path):
    webdataset = pytest.importorskip("webdataset", reason="webdataset is not installed")
    export(dataset.folder, tmp_path / "shards", format="webdataset", **QUIET)
    reader = webdataset.WebDataset(str(tmp_path / "shards/train-000000.tar"), shardshuffle=False).decode("rgb8")
    seen = 0
    for sample, frame in zip(reader, dataset.frames, strict=True):
        assert sample["__key__"] == frame.name
        assert np.array_equal(sample["image.png"], frame.image)
        assert sample["frame.json"]["water"]["name"] == frame.info.water.name
        assert np.array_equal(sample["truth.npz"]["z_depth"], frame.buffer("z_depth"))
        seen += 1
    assert seen == len(dataset)


def test_shares_are_read_and_refused():
    assert shares_from_text("train=0.8, val=0.1,test=0.1") == {"train": 0.8, "val": 0.1, "test": 0.1}
    for text in ("", "train", "train=0.8", "train=0.5,train=0.5", "dev=1", "train=x", "train=1.5,test=-0.5"):
        with pytest.raises(ValueError, match="--split: got .*allowed: such as train=0.8"):
            shares_from_text(text)


def test_a_scene_is_in_one_split(tmp_path):
    scenes = [f"reef_{number // 3}" for number in range(30)]
    dataset = of_scenes(tmp_path, scenes)
    splits = frame_splits(dataset, {"train": 0.6, "val": 0.2, "test": 0.2})
    of_scene = {}
    for name, scene in zip(dataset.frame_names, scenes, strict=True):
        assert of_scene.setdefault(scene, splits[name]) == splits[name]
    assert {name: list(of_scene.values()).count(name) for name in ("train", "val", "test")} == {
        "train": 6, "val": 2, "test": 2
    }  # fmt: skip
    assert frame_splits(dataset, {"train": 0.6, "val": 0.2, "test": 0.2}) == splits
    few = frame_splits(of_scenes(tmp_path / "three", ["a", "b", "c"]), {"train": 0.9, "val": 0.05, "test": 0.05})
    assert sorted(few.values()) == ["test", "train", "val"]
    with pytest.raises(ValueError, match="got 3 splits for 1 scene"):
        frame_splits(of_scenes(tmp_path / "few", ["a", "a", "a"]), {"train": 0.6, "val": 0.2, "test": 0.2})


def test_a_recipe_states_splits_itself(tmp_path):
    dataset = of_scenes(tmp_path, ["a", "a", "b"], ["one", "one", "two"])
    recipe = {"group": [{"name": "one", "split": "train"}, {"name": "two", "split": "test"}]}
    stated = store.Dataset(dataset.folder, dataset.manifest | {"recipe": recipe}, dataset.frame_names)
    assert frame_splits(stated, None) == {"000000": "train", "000001": "train", "000002": "test"}
    with pytest.raises(ValueError, match="states its splits itself"):
        frame_splits(stated, {"train": 1.0})
    del recipe["group"][1]["split"]
    with pytest.raises(ValueError, match="group two has no split"):
        frame_splits(stated, None)


@pytest.mark.parametrize(("name", "file"), [
    ("coco", "annotations/instances_{}.json"), ("pairs", "{}/pairs.csv"), ("webdataset", "{}-000000.tar"),
    ("bop", "{}/000001/scene_gt.json"),
])  # fmt: skip
def test_every_format_has_the_splits(tmp_path, name, file):
    dataset = of_scenes(tmp_path, ["a", "b", "b"])
    export(dataset.folder, tmp_path / "out", format=name, shares={"train": 0.5, "test": 0.5}, progress=lambda *_: None)
    assert all((tmp_path / "out" / file.format(split)).is_file() for split in ("train", "test"))


def test_formats_are_the_files_of_the_folder(dataset, tmp_path):
    assert discovery.names(formats) == NAMES
    with pytest.raises(ValueError, match="formats: got 'yolo', allowed: bop, coco, euroc"):
        export(dataset.folder, tmp_path / "out", format="yolo", **QUIET)


@pytest.mark.parametrize("name", ["bop", "coco", "pairs", "webdataset"])
def test_an_export_that_fails_leaves_nothing(tmp_path, name):
    dataset = synthetic.write_dataset(tmp_path / "data", (0, 1))
    path = dataset.folder / "frames/000001/frame.exr"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(ValueError, match="not a readable EXR"):
        export(dataset.folder, tmp_path / "out", format=name, **QUIET)
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_nothing_is_overwritten(dataset, tmp_path):
    (tmp_path / "out").mkdir()
    with pytest.raises(ValueError, match="exists already, allowed: a new folder"):
        export(dataset.folder, tmp_path / "out", format="pairs", **QUIET)
    with pytest.raises(ValueError, match="lies inside the dataset"):
        export(dataset.folder, dataset.folder / "out", format="pairs", **QUIET)
    with pytest.raises(ValueError, match="does not exist"):
        export(dataset.folder, tmp_path / "none/out", format="pairs", **QUIET)
    assert list(tmp_path.iterdir()) == [tmp_path / "out"] and not list((tmp_path / "out").iterdir())


def test_what_a_killed_run_left_is_replaced(dataset, tmp_path):
    (tmp_path / "out.partial").mkdir()
    (tmp_path / "out.partial/rubbish").touch()
    export(dataset.folder, tmp_path / "out", format="pairs", **QUIET)
    assert {path.name for path in tmp_path.iterdir()} == {"out"} and not (tmp_path / "out/rubbish").exists()


def test_only_bop_takes_silhouettes(dataset, tmp_path):
    with pytest.raises(ValueError, match="--silhouettes: got format coco, which has none"):
        export(dataset.folder, tmp_path / "out", format="coco", silhouettes=lambda dataset: None, **QUIET)
