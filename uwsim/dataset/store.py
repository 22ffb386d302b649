"""A dataset folder: dataset.json beside frames/ and, of moving rigs, sequences/; see FORMAT.md."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from uwsim.dataset.frame import FORMAT_VERSION, Frame, read_frame
from uwsim.dataset.sequence import Sequence, read_sequence
from uwsim.files import read_json, sha256, write_json
from uwsim.validation import validated

FOLDERS = ("frames", "sequences")


@dataclass(frozen=True)
class Dataset:
    """A complete dataset; `manifest` is the content of dataset.json."""

    folder: Path
    manifest: dict
    frame_names: tuple[str, ...]
    sequence_names: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.frame_names)

    def frame(self, name: str) -> Frame:
        return read_frame(self.folder / "frames" / name)

    @property
    def frames(self):
        """The frames in order, opened one after the other."""
        return (self.frame(name) for name in self.frame_names)

    @property
    def sequences(self) -> tuple[Sequence, ...]:
        """The sequences in order of their names; none in a dataset of single frames."""
        return tuple(read_sequence(self.folder / "sequences" / name) for name in self.sequence_names)

    @property
    def name(self) -> str:
        return self.manifest["name"]

    @property
    def seed(self) -> int:
        return self.manifest["seed"]

    @property
    def sha256(self) -> str:
        """Hash of dataset.json, which holds those of all files."""
        return sha256(self.folder / "dataset.json")


def open(folder: Path) -> Dataset:  # noqa: A001 (the published name is uwsim.dataset.open)
    """Open a complete dataset; ValueError in one line if it is missing, unfinished or of another format."""
    folder = Path(folder)
    manifest = read_manifest(folder)
    if not manifest["complete"]:
        raise ValueError(f"{folder}: generation is unfinished; finish it with `uwsim generate ... --resume`")
    parts = {Path(file).parts[:2] for file in manifest["files"]}
    frames, sequences = (tuple(sorted(name for kind, name in parts if kind == wanted)) for wanted in FOLDERS)
    if not frames:
        raise ValueError(f"{folder}: the dataset has no frames")
    return Dataset(folder=folder, manifest=manifest, frame_names=frames, sequence_names=sequences)


class Failure(BaseModel):
    """Why a frame of the recipe is not in the dataset; (seed, its number) make it again."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    seed: int
    error: str


class Manifest(BaseModel):
    """The contents of dataset.json."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal[FORMAT_VERSION]
    name: str
    complete: bool
    seed: int
    recipe: dict
    scenes_sha256: str
    versions: dict
    commit: str | None
    machine: dict
    files: dict[str, str]
    failed: dict[str, Failure] = {}


def read_manifest(folder: Path) -> dict:
    """Read and check dataset.json; ValueError in one line."""
    path = Path(folder) / "dataset.json"
    if not path.is_file():
        raise ValueError(f"{folder}: no dataset here (dataset.json is missing)")
    manifest = read_json(path)
    validated(Manifest, manifest, where=path)
    for file in manifest["files"]:
        parts = Path(file).parts
        if len(parts) != 3 or parts[0] not in FOLDERS or ".." in parts:
            raise ValueError(
                f"{path}: file {file!r} is not of the form frames/<frame>/<file> or sequences/<sequence>/<file>"
            )
    return manifest


def write_manifest(folder: Path, manifest: dict) -> None:
    """Write dataset.json atomically."""
    write_json(Path(folder) / "dataset.json", manifest)


def checksums(folder: Path) -> dict[str, str]:
    """Return {path inside the dataset: SHA-256} of every file of every complete frame and sequence, sorted."""
    found = (path for part in FOLDERS for path in (Path(folder) / part).glob("*/*"))
    files = sorted(path for path in found if not path.parent.name.endswith(".partial"))
    return {path.relative_to(folder).as_posix(): sha256(path) for path in files}
