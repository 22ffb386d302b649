"""The numbers of a restoration benchmark, ordered for tables and figures: by case, method, water and scene."""

import math
from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.bench import study
from uwsim.bench.records import Result, summarise
from uwsim.dataset.store import Dataset

OURS = ("dual_transmission", "lamp_model")
"""Methods of this project; what else sees no layer of the truth is a rival."""
MAIN = (
    "dual_transmission", "lamp_model", "dual_transmission_as_printed", "clahe", "msrcr", "agcwd", "wgif_detail",
    "fusion", "udcp", "sea_thru",
)  # fmt: skip
"""Methods that figures show, the most telling first."""
LAYERS = frozenset(("backscatter", "transmission", "forward_scatter", "direct_gain", "noise_std"))
"""Inputs that are layers of the truth: whoever is given one is an oracle."""


@dataclass(frozen=True)
class Shot:
    """A still frame: which scene it shows, through which water. `attenuation_per_m`: c of the green band."""

    case: str
    scene: str
    water: str
    attenuation_per_m: float


def shots(dataset: Dataset) -> list[Shot]:
    """Return the still frames in order.

    The frames of a scene follow one another in a group, one for each water: the next scene begins where the group
    changes or a water comes again. A scene is named after its group, with a number where the group has several.
    """
    found, scenes, seen = [], [], set()
    for frame in dataset.frames:
        info = frame.info
        if info.blur is not None:
            continue
        if not scenes or info.group != scenes[-1][0] or info.water.name in seen:
            number = 1 + sum(group == info.group for group, _ in scenes)
            scenes.append((info.group, number))
            seen = set()
        seen.add(info.water.name)
        found.append((info.name, scenes[-1], info.water.name, info.water.bands.attenuation_per_m[1]))
    several = {group for group, count in Counter(group for group, _ in scenes).items() if count > 1}
    return [
        Shot(case, f"{group} {number}" if group in several else group, water, attenuation)
        for case, (group, number), water, attenuation in found
    ]


@dataclass(frozen=True)
class Study(study.Study):
    """A result, read by name, and the shots that its cases are."""

    shots: tuple[Shot, ...]

    @cached_property
    def cases(self) -> list[Shot]:
        """The shots that were scored."""
        scored = {record.case for record in self.result.records}
        return [shot for shot in self.shots if shot.case in scored]

    @cached_property
    def waters(self) -> list[str]:
        """The waters of the cases, from clear to turbid."""
        attenuations: dict[str, list[float]] = {}
        for shot in self.cases:
            attenuations.setdefault(shot.water, []).append(shot.attenuation_per_m)
        return sorted(attenuations, key=lambda water: (np.mean(attenuations[water]), water))

    @cached_property
    def scenes(self) -> list[str]:
        """The scenes of the dataset in order, scored or not."""
        return list(dict.fromkeys(shot.scene for shot in self.shots))

    @cached_property
    def given(self) -> dict[str, tuple[str, ...]]:
        """Method -> what it was shown besides the picture."""
        return {record.algorithm: tuple(record.given) for record in self.result.records}

    @cached_property
    def restorers(self) -> list[str]:
        """The methods that see no layer of the truth and do something, in table order."""
        oracles = {name for name, given in self.given.items() if LAYERS & set(given)}
        return [name for name in self.methods if name not in oracles and name not in (self.raw, self.oracle)]

    @cached_property
    def ours(self) -> list[str]:
        return [name for name in OURS if name in self.restorers]

    @cached_property
    def rivals(self) -> list[str]:
        """The restorers that are neither ours nor a form of ours."""
        variants = self.definition.get("variants", {})
        forms = {name for name, variant in variants.items() if variant["algorithm"] in OURS}
        forms |= {name for name in self.restorers for own in OURS if name == f"{own}_as_printed"}
        return [name for name in self.restorers if name not in OURS and name not in forms]

    def unscored(self, method: str) -> dict[str, str]:
        """Return {case: why} of the cases in which a method has no score at all."""
        found = {}
        for shot in self.cases:
            records = [r for metric in self.of_metric if (r := self.record(shot.case, method, metric)) is not None]
            if records and all(record.value is None and record.note != "identical images" for record in records):
                found[shot.case] = records[0].note
        return found

    def of_water(self, water: str | None) -> list[str]:
        """Return the cases of a water; of all where it is None."""
        return [shot.case for shot in self.cases if water in (None, shot.water)]

    def summary(self, method: str, metric: str, water: str | None = None) -> float:
        """Return the benchmark's own statistic over the cases (of a water): inf and NaN as in its records."""
        found = []
        for case in self.of_water(water):
            record = self.record(case, method, metric)
            identical = record is not None and record.note == "identical images"
            found.append(math.inf if identical else self.value(case, method, metric))
        return summarise(found, self.result.provenance["statistics"].get(metric, "mean"))[0]

    def mean(self, method: str, metric: str, water: str | None = None) -> float:
        """Return the mean over the cases (of a water) that have a score; NaN if none has."""
        return _mean([self.value(case, method, metric) for case in self.of_water(water)])

    def gain(self, method: str, metric: str, water: str | None = None) -> float:
        """Return the mean over the cases (of a water) of what a method gains over the picture as it is."""
        return _mean(
            [self.value(case, method, metric) - self.value(case, self.raw, metric) for case in self.of_water(water)]
        )

    def best(self, methods: list[str], metric: str, water: str | None = None) -> str | None:
        """Return the method of the best summary; None where none has one."""
        found = {name: self.summary(name, metric, water) for name in methods}
        known = {name: value for name, value in found.items() if not math.isnan(value)}
        if not known:
            return None
        choose = max if self.of_metric[metric].better == "higher" else min
        return choose(known, key=known.get)

    def case_of(self, scene: str, water: str) -> str | None:
        """Return the case of a scene in a water, None if it was not scored."""
        return next((shot.case for shot in self.cases if (shot.scene, shot.water) == (scene, water)), None)


def study_of(result: Result, dataset: Dataset) -> Study:
    """Return the study of a result on the dataset that it was made on."""
    return Study(result, tuple(shots(dataset)))


def _mean(values: list[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return math.fsum(known) / len(known) if known else math.nan


def joined(names: list[str]) -> str:
    """Return "a, b and c"."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)
