"""The command line of uwsim, run by the timings of this folder."""

import subprocess
import sys
from pathlib import Path


def generate(recipe: Path, out: Path, *options: str) -> None:
    """Generate a dataset from a recipe file by a process of its own."""
    arguments = ["generate", str(recipe), "--out", str(out), *options]
    command = [sys.executable, "-c", "from uwsim import cli; cli.main()", *arguments]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
