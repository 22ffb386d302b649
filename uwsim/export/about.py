"""dataset_info.md: what an export is made of, and its conventions where the format leaves a choice."""

from pathlib import Path

from uwsim.dataset.store import Dataset
from uwsim.files import write_text

FILE = "dataset_info.md"


def write_about(folder: Path, dataset: Dataset, *, title: str, paragraphs: list[str]) -> None:
    """Write `folder`/dataset_info.md: title, where the data come from, paragraphs."""
    manifest = dataset.manifest
    versions = ", ".join(f"{name} {version}" for name, version in manifest["versions"].items() if name == "uwsim")
    origin = (
        f"Made from the dataset `{dataset.name}` ({len(dataset)} frames, seed {manifest['seed']}, {versions}), which "
        "was rendered: nothing here was measured or annotated by hand. The world has z up and the water surface at "
        "z = 0; lengths of the world are in metres where the format does not say otherwise."
    )
    write_text(Path(folder) / FILE, "\n\n".join([f"# {dataset.name}: {title}", origin, *paragraphs]) + "\n")
