"""What the timings of this folder are written as: tidy records with versions and machine."""

import json
from pathlib import Path


def write(records: list[dict], *, quick: bool, where: str | None) -> None:
    """Write records as JSON to a file, - for standard output, None for nowhere."""
    from uwsim import provenance
    from uwsim.render import llvm

    choice = llvm.choose()
    found = {
        "versions": provenance.versions(),
        "machine": provenance.machine(libllvm=choice.path, llvm_version=choice.version),
        "commit": provenance.commit(),
        "quick": quick,
        "records": records,
    }
    text = json.dumps(found, indent=1)
    if where == "-":
        print(text)
    elif where:
        Path(where).write_text(text + "\n", encoding="utf-8")
