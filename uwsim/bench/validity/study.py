"""The numbers of a validity benchmark, ordered for tables and figures: by case, model, and what the case was like."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.bench import study

IMAGE_ERROR = "relative_radiance_error"
FITTED = "_fitted"
_SAME = 1.15  # ratio of neighbouring values that count as one on an axis


@dataclass(frozen=True)
class Study(study.Study):
    """A result, read by name and by the conditions of its cases."""

    @cached_property
    def cases(self) -> list[str]:
        return list(self.conditions)

    @cached_property
    def models(self) -> list[str]:
        """What takes part, in table order, without do-nothing and oracle."""
        return [name for name in self.methods if name not in (self.raw, self.oracle)]

    @cached_property
    def physical(self) -> list[str]:
        """The models as they are: neither fitted nor with keywords of their own."""
        variants = self.definition.get("variants", {})
        changed = {name for name, variant in variants.items() if variant["fitted"] or variant["keywords"]}
        return [name for name in self.models if name not in changed]

    @cached_property
    def fitted(self) -> dict[str, str]:
        """Model -> its fitted variant, of those that have one."""
        return {name: name + FITTED for name in self.physical if name + FITTED in self.models}

    def value(self, case: str, method: str, metric: str = IMAGE_ERROR) -> float:
        """Return a score; NaN where there is none."""
        return super().value(case, method, metric)

    def seen_error(self, case: str, model: str) -> float:
        """Return the image error, or what the truth's noise hides where that is more. [%]"""
        hidden = self.conditions[case]["resolution_percent"]
        return max(self.value(case, model), hidden)

    def median(self, model: str, metric: str = IMAGE_ERROR, cases: list[str] | None = None) -> float:
        """Return the median over cases that have a value; NaN if none has."""
        found = [self.value(case, model, metric) for case in (self.cases if cases is None else cases)]
        found = [value for value in found if not math.isnan(value)]
        return float(np.median(found)) if found else math.nan

    def share_within(self, model: str, percent: float, cases: list[str] | None = None) -> float:
        """Return the share of the cases in which the image error is surely at most so large. [%]"""
        cases = self.cases if cases is None else cases
        return 100 * sum(self.seen_error(case, model) <= percent for case in cases) / len(cases)

    def steps(self, condition: str) -> list[tuple[float, list[str]]]:
        """Return [(value, cases)] of a condition in ascending order; values within 15 % of the next are one step."""
        ordered = sorted(self.cases, key=lambda case: self.conditions[case][condition])
        steps: list[list[str]] = []
        last = -math.inf
        for case in ordered:
            value = self.conditions[case][condition]
            if not steps or value > _SAME * last + 1e-9:
                steps.append([])
            steps[-1].append(case)
            last = value
        return [(float(np.median([self.conditions[case][condition] for case in step])), step) for step in steps]

    def nearest(self, cases: list[str] | None = None, **wanted: float) -> str:
        """Return the case whose conditions are nearest to the wanted ones, by the sum of relative differences."""

        def distance(case: str) -> float:
            return sum(abs(self.conditions[case][key] - value) / abs(value) for key, value in wanted.items())

        return min(self.cases if cases is None else cases, key=distance)


def title(model: str) -> str:
    """Return a model's name for people: "Jaffe-McGlamery, fitted"."""
    names = {
        "beer_lambert": "Beer-Lambert", "revised": "Akkaynak-Treibitz", "jaffe_mcglamery": "Jaffe-McGlamery",
        "oracle_noise": "Monte-Carlo noise",
    }  # fmt: skip
    for name, text in names.items():
        if model == name:
            return text
        if model.startswith(f"{name}_"):
            return f"{text} {model[len(name) + 1 :].replace('_', ' ')}"
    return model.replace("_", " ")
