"""Train, validation, test: by scene, so that no place is in two splits."""

import hashlib
import math

from uwsim.dataset.store import Dataset

DEFAULT = "train"
NAMES = ("train", "val", "test")


def shares_from_text(text: str) -> dict[str, float]:
    """Return {split: share} of `train=0.8,val=0.1,test=0.1`; ValueError unless they are positive and sum to 1."""
    wrong = f"--split: got {text!r}, allowed: such as train=0.8,val=0.1,test=0.1, which sum to 1"
    shares: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = part.strip().partition("=")
        try:
            share = float(number)
        except ValueError:
            raise ValueError(wrong) from None
        if name not in NAMES or name in shares or not equals or not (0 < share <= 1):
            raise ValueError(wrong)
        shares[name] = share
    if not math.isclose(sum(shares.values()), 1, abs_tol=1e-9):
        raise ValueError(wrong)
    return shares


def frame_splits(dataset: Dataset, shares: dict[str, float] | None) -> dict[str, str]:
    """Return {frame name: split}.

    Without `shares` a frame is in the split that its group has in the dataset's recipe, and all are in `train` where
    no group has one. With `shares` (share of the scenes, not of the frames) all frames of a scene are in one split,
    drawn by the dataset's seed. Raises ValueError where some groups have a split and others none, where both are
    given, and where there are fewer scenes than splits.
    """
    groups = dataset.manifest["recipe"].get("group", [])
    stated = {group["name"]: group["split"] for group in groups if group.get("split") is not None}
    infos = [frame.info for frame in dataset.frames]
    if stated and shares is not None:
        raise ValueError(f"--split: the dataset {dataset.folder} states its splits itself, allowed: no --split")
    if stated:
        if missing := sorted({info.group for info in infos} - set(stated)):
            raise ValueError(
                f"{dataset.folder}: group {missing[0]} has no split, others have one; allowed: all or none"
            )
        return {info.name: stated[info.group] for info in infos}
    if shares is None:
        return {info.name: DEFAULT for info in infos}
    split_of_scene = _drawn(sorted({info.scene for info in infos}), shares, dataset)
    return {info.name: split_of_scene[info.scene] for info in infos}


def _drawn(scenes: list[str], shares: dict[str, float], dataset: Dataset) -> dict[str, str]:
    """Return {scene: split}: numbers of scenes by largest remainder, at least one each; which ones by a checksum."""
    if len(scenes) < len(shares):
        raise ValueError(
            f"--split: got {len(shares)} splits for {len(scenes)} scene(s) in {dataset.folder}, "
            "allowed: at least one scene for each, because frames of a scene stay together"
        )
    wanted = {name: share * len(scenes) for name, share in shares.items()}
    counts = {name: math.floor(number) for name, number in wanted.items()}
    by_remainder = sorted(wanted, key=lambda name: counts[name] - wanted[name])
    for name in by_remainder[: len(scenes) - sum(counts.values())]:
        counts[name] += 1
    for name in (name for name in shares if counts[name] == 0):
        counts[max(counts, key=counts.get)] -= 1
        counts[name] = 1
    seed = dataset.manifest["seed"]
    mixed = sorted(scenes, key=lambda scene: hashlib.sha256(f"{seed} {scene}".encode()).digest())
    names = [name for name in shares for _ in range(counts[name])]
    return dict(zip(mixed, names, strict=True))
