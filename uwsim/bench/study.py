"""A benchmark's result, read by name: what tables and figures of every benchmark ask for."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.bench.records import TITLES, Record, Result


@dataclass(frozen=True)
class Study:
    """A result, read by name."""

    result: Result

    @cached_property
    def conditions(self) -> dict[str, dict]:
        """Case -> what it was like, in order."""
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
    def of_metric(self) -> dict[str, Record]:
        """Metric -> one of its records, for its unit and direction; in table order."""
        found: dict[str, Record] = {}
        for record in self.result.records:
            found.setdefault(record.metric, record)
        return found

    @cached_property
    def _records(self) -> dict[tuple[str, str, str], Record]:
        return {(record.case, record.algorithm, record.metric): record for record in self.result.records}

    def record(self, case: str, method: str, metric: str) -> Record | None:
        """Return a record of a case or a summary, None if there is none."""
        return self._records.get((case, method, metric))

    def value(self, case: str, method: str, metric: str) -> float:
        """Return a score of a case or a summary; NaN where there is none."""
        record = self.record(case, method, metric)
        return math.nan if record is None or record.value is None else record.value


@dataclass(frozen=True)
class StudyByCondition(Study):
    """A result, read by the conditions of its cases."""

    @cached_property
    def rivals(self) -> list[str]:
        """The methods that do something and are given nothing of the truth."""
        return [name for name in self.methods if name not in (self.raw, self.oracle)]

    def cases(self, **wanted: object) -> list[str]:
        """Return the cases of which all these conditions hold; a tuple, list or set: any of its values."""
        several = {key: value if isinstance(value, tuple | list | set) else (value,) for key, value in wanted.items()}
        return [name for name, one in self.conditions.items() if all(one[key] in some for key, some in several.items())]

    def steps(self, condition: str, cases: Iterable[str] | None = None) -> list:
        """Return the values of a condition among the cases, in ascending order, without None."""
        found = {self.conditions[case][condition] for case in (self.conditions if cases is None else cases)}
        return sorted(found - {None})

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


def title(name: str) -> str:
    """Return the name of a method, a metric or a water for people: "dual transmission as printed"."""
    return TITLES.get(name, name.replace("_", " "))
