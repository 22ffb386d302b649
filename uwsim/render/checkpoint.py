"""The sums of an unfinished frame on disk: a killed render goes on where it was, with the same bytes in the end."""

import hashlib
import json
import time
import zipfile
from pathlib import Path

import numpy as np

from uwsim import files, provenance
from uwsim.render.accumulate import Sums
from uwsim.scene.models import Scene

_SAVE_EVERY_S = 20.0
_PARTS = ("sums", "squares", "region_sums", "region_squares")
# what can change the light of a picture
_PACKAGES = ("uwsim", "mitsuba", "drjit", "numpy")


class Checkpoint:
    """A file with the sums of a frame's pictures by name, and what they are the sums of.

    identity: as `identity` gives it. resume: the file must be there, and of the same identity; else it must not.
    Raises ValueError in one line.
    """

    def __init__(self, path: Path, *, identity: dict, resume: bool):
        self.path, self.identity, self.pictures = Path(path), identity, {}
        self._saved_s = time.monotonic()
        if resume:
            self.pictures = _read(self.path, identity)
        elif self.path.exists():
            raise ValueError(f"checkpoint {path}: exists already; go on from it with --resume, or choose another file")
        elif not self.path.resolve().parent.is_dir():
            raise ValueError(f"checkpoint {path}: the folder {self.path.parent} does not exist")

    def sums(self, name: str) -> Sums | None:
        """Return the sums stored for a picture, None if it was not begun."""
        return self.pictures.get(name)

    def store(self, name: str, sums: Sums, *, now: bool) -> None:
        """Take in the sums of a picture, and write the file if `now` or if the last time is long ago."""
        self.pictures[name] = sums
        if now or time.monotonic() - self._saved_s > _SAVE_EVERY_S:
            files.write_atomically(self.path, self._write)
            self._saved_s = time.monotonic()

    def _write(self, path: Path) -> None:
        arrays = {"identity": np.array(json.dumps(self.identity, sort_keys=True))}
        for name, sums in self.pictures.items():
            arrays[f"{name}/batches"] = np.array(sums.batches)
            arrays |= {f"{name}/{part}": getattr(sums, part) for part in _PARTS}
        with path.open("wb") as stream:
            np.savez(stream, **arrays)


def identity(scene: Scene, *, seed: int, frame: int, samples_per_batch: int, variant: str) -> dict:
    """Return what two renders must share to be parts of one: scene with its files, seed, samples, versions."""
    versions = provenance.versions()
    return {
        "scene": fingerprint([scene]),
        "size": f"{scene.rig.camera.width_px}x{scene.rig.camera.height_px}",
        "seed": seed,
        "frame": frame,
        "samples per batch": samples_per_batch,
        "versions": " ".join(f"{name} {versions.get(name, 'none')}" for name in _PACKAGES) + f" {variant}",
    }


def fingerprint(scenes: list[Scene]) -> str:
    """Return a checksum of what is rendered: the scenes, with the contents of their files for their names."""
    digest = hashlib.sha256()
    for scene in scenes:
        digest.update(json.dumps(scene.model_dump(), sort_keys=True, default=files.sha256).encode())
    return digest.hexdigest()


def _read(path: Path, identity: dict) -> dict[str, Sums]:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as found:
            arrays = dict(found)
        stored = json.loads(str(arrays.pop("identity")))
        names = dict.fromkeys(key.partition("/")[0] for key in arrays)
        pictures = {
            name: Sums(int(arrays[f"{name}/batches"]), *(arrays[f"{name}/{part}"] for part in _PARTS)) for name in names
        }
    except FileNotFoundError:
        raise ValueError(f"checkpoint {path}: no such file; begin without --resume") from None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"checkpoint {path}: not readable as a checkpoint: {error}") from None
    for key, value in identity.items():
        if stored.get(key) != value:
            raise ValueError(
                f"checkpoint {path}: holds another {key}, got {stored.get(key)!r}, allowed: {value!r}; "
                "choose another file or begin without --resume"
            )
    return pictures
