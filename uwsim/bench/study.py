"""A benchmark's result, read by name: what tables and figures of every benchmark ask for."""

import math
from dataclasses import dataclass
from functools import cached_property

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


def title(name: str) -> str:
    """Return the name of a method, a metric or a water for people: "dual transmission as printed"."""
    return TITLES.get(name, name.replace("_", " "))
