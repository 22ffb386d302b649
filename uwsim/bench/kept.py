"""Scores of finished cases in a file: a benchmark that was killed goes on where it was."""

import json
from pathlib import Path

Scores = dict[str, dict[str, object]]
"""By algorithm: metric -> value."""


class Kept:
    """Scores by case in a file of JSON lines, the first of which says what they are scores of.

    identity: what two runs must share to be parts of one. resume: the file must be there, and of the same identity;
    else it must not. Raises ValueError in one line.
    """

    def __init__(self, path: Path, *, identity: dict, resume: bool):
        self.path, self.cases = Path(path), {}
        if resume:
            self.cases = _read(self.path, identity)
        elif self.path.exists():
            raise ValueError(f"checkpoint {path}: exists already; go on from it with --resume, or choose another file")
        elif not self.path.resolve().parent.is_dir():
            raise ValueError(f"checkpoint {path}: the folder {self.path.parent} does not exist")
        # what a killed run left of a line is not taken over
        lines = [identity, *({"case": case, "scores": scores} for case, scores in self.cases.items())]
        self.path.write_text("".join(_line(line) for line in lines), encoding="utf-8")

    def scores(self, case: str) -> Scores | None:
        """Return the scores of a finished case, None if it is not."""
        return self.cases.get(case)

    def add(self, case: str, scores: Scores) -> None:
        """Take in the scores of a case."""
        self.cases[case] = scores
        with self.path.open("a", encoding="utf-8") as stream:
            stream.write(_line({"case": case, "scores": scores}))


def _line(value: dict) -> str:
    # scores may be NaN and infinite: JSON as Python has it
    return json.dumps(value, default=float) + "\n"


def _read(path: Path, identity: dict) -> dict[str, Scores]:
    try:
        text = path.read_text(encoding="utf-8")
        whole = text[: text.rfind("\n") + 1].splitlines()
        stored, *lines = [json.loads(line) for line in whole]
        cases = {line["case"]: line["scores"] for line in lines}
    except FileNotFoundError:
        raise ValueError(f"checkpoint {path}: no such file; begin without --resume") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"checkpoint {path}: not readable as scores of a benchmark: {error}") from None
    for key, value in json.loads(_line(identity)).items():
        if not isinstance(stored, dict) or stored.get(key) != value:
            raise ValueError(
                f"checkpoint {path}: holds scores of another {key}, allowed: of the same; "
                "choose another file or begin without --resume"
            )
    return cases
