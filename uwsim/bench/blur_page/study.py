"""The numbers of a blur benchmark, ordered for tables and figures: by case, method, and what the case was like."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.bench.records import TITLES, Record, Result
from uwsim.metrics.blur import MEDIAN_OVER_SD

OURS = "whittle"
PRINTED = "cepstrum_morphology"
"""The dissertation's estimator, every step as described."""
MENDED = "cepstrum_morphology_mended"
DECONVOLVER = "mmse"
"""The deconvolver whose gains have a goal."""


@dataclass(frozen=True)
class Study:
    """A result, read by name."""

    result: Result

    @cached_property
    def conditions(self) -> dict[str, dict]:
        return self.result.provenance["conditions"]

    @cached_property
    def methods(self) -> list[str]:
        """What took part, in table order."""
        return list(dict.fromkeys(record.algorithm for record in self.result.records))

    @property
    def definition(self) -> dict:
        return self.result.provenance["definition"]

    @property
    def raw(self) -> str:
        """The method that does nothing."""
        return self.definition["do_nothing"]

    @property
    def oracle(self) -> str | None:
        return self.definition.get("oracle")

    @cached_property
    def rivals(self) -> list[str]:
        """The methods that do something and are given nothing of the truth."""
        return [name for name in self.methods if name not in (self.raw, self.oracle)]

    @cached_property
    def of_metric(self) -> dict[str, Record]:
        """Metric -> one of its records, for its unit and direction; in table order."""
        found: dict[str, Record] = {}
        for record in self.result.records:
            found.setdefault(record.metric, record)
        return found

    @cached_property
    def _values(self) -> dict[tuple[str, str, str], float]:
        return {
            (record.case, record.algorithm, record.metric): math.nan if record.value is None else record.value
            for record in self.result.records
        }

    def cases(self, **wanted: object) -> list[str]:
        """Return the cases of which all these conditions hold; a tuple, list or set: any of its values."""
        several = {key: value if isinstance(value, tuple | list | set) else (value,) for key, value in wanted.items()}
        return [name for name, one in self.conditions.items() if all(one[key] in some for key, some in several.items())]

    def steps(self, condition: str, cases: Iterable[str] | None = None) -> list:
        """Return the values of a condition among the cases, in ascending order, without None."""
        found = {self.conditions[case][condition] for case in (self.conditions if cases is None else cases)}
        return sorted(found - {None})

    def value(self, case: str, method: str, metric: str) -> float:
        """Return a score; NaN where there is none."""
        return self._values.get((case, method, metric), math.nan)

    def values(self, method: str, metric: str, cases: Iterable[str]) -> np.ndarray:
        """Return the scores of a method in these cases that there are."""
        found = np.array([self.value(case, method, metric) for case in cases])
        return found[~np.isnan(found)]

    def median(self, method: str, metric: str, cases: Iterable[str]) -> float:
        """Return the median of the scores that there are; NaN if there are none."""
        found = self.values(method, metric, cases)
        return float(np.median(found)) if found.size else math.nan

    def mean(self, method: str, metric: str, cases: Iterable[str]) -> float:
        """Return the mean of the scores that there are; NaN if there are none."""
        found = self.values(method, metric, cases)
        return math.fsum(found) / found.size if found.size else math.nan

    def summary(self, method: str, metric: str, cases: Iterable[str]) -> float:
        """Return the benchmark's own statistic of a metric over these cases."""
        mean = self.result.provenance["statistics"].get(metric, "mean") == "mean"
        return (self.mean if mean else self.median)(method, metric, cases)

    def rms_to_bound(self, method: str, quantity: str, cases: Iterable[str]) -> float:
        """Return the root mean square of a method's errors over the bound; quantity: length or angle."""
        found = self.values(method, f"{quantity}_error_to_bound_ratio", cases)
        return MEDIAN_OVER_SD * float(np.sqrt(np.mean(found**2))) if found.size else math.nan

    def bound(self, case: str, quantity: str) -> float:
        """Return the bound of a case, length [px] or angle [deg]: the largest error among the methods over its ratio.

        NaN where no method has an error.
        """
        metric = {"length": "length_error_px", "angle": "angle_error_deg"}[quantity]
        errors = {name: self.value(case, name, metric) for name in self.methods}
        known = {name: error for name, error in errors.items() if error > 0}
        if not known:
            return math.nan
        worst = max(known, key=known.get)
        return known[worst] / self.value(case, worst, f"{quantity}_error_to_bound_ratio") / MEDIAN_OVER_SD


def title(name: str) -> str:
    """Return the name of a method or a metric for people."""
    return TITLES.get(name, name.replace("_", " "))
