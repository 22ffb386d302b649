"""Files that are complete or absent, checksums, and the data that ships with the package."""

import contextlib
import gzip
import hashlib
import json
import os
import tomllib
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

PACKAGE = Path(__file__).parent


def write_atomically(path: Path, write: Callable[[Path], None]) -> None:
    """Call `write(temporary path)` and move the result to `path`; nothing is left behind on failure."""
    path = Path(path)
    temporary = path.with_name(f".partial-{os.getpid()}-{path.name}")
    try:
        write(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file atomically; compressed where the name ends in .gz, the same text to the same bytes."""
    data = text.encode()
    packed = gzip.compress(data, mtime=0) if Path(path).suffix == ".gz" else data
    write_atomically(path, lambda temporary: temporary.write_bytes(packed))


def write_json(path: Path, value: object) -> None:
    """Write JSON atomically, keys in the given order, NaN and infinity refused (ValueError)."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def read_json(path: Path) -> object:
    """Read a JSON file, compressed if its name ends in .gz; ValueError in one line if it is missing or broken."""
    try:
        data = Path(path).read_bytes()
        return json.loads(gzip.decompress(data) if Path(path).suffix == ".gz" else data)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path}: not readable as JSON: {error}") from error


def read_toml(path: Path) -> dict:
    """Read a TOML file as a dictionary; ValueError in one line."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path}: not readable as TOML: {error}") from None


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder for this process until the block or the process ends; ValueError if another one holds it.

    Does nothing where the system has no such locks.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    held = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f"{folder}: another run is writing there; allowed: one at a time") from None
        except OSError:
            pass  # a file system without locks
        yield
    finally:
        os.close(held)


@contextlib.contextmanager
def no_stderr() -> Iterator[None]:
    """Silence what compiled libraries write to the standard error stream of the process."""
    kept = os.dup(2)
    try:
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def sha256(path: Path) -> str:
    """Return the SHA-256 checksum of a file as 64 hexadecimal digits."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def shipped(folder: str) -> Path:
    """Return the folder `scenes` or `benchmarks`: in the wheel, else at the top of the source tree."""
    inside = PACKAGE / "shipped" / folder
    return inside if inside.is_dir() else PACKAGE.parent / folder


def find_shipped(folder: str, name: str) -> Path:
    """Return a TOML file given by its path, or by its name in a shipped folder.

    Raises ValueError that lists the known names.
    """
    if Path(name).suffix == ".toml" and Path(name).is_file():
        return Path(name)
    candidate = shipped(folder) / (name if name.endswith(".toml") else f"{name}.toml")
    if candidate.is_file():
        return candidate
    # a path inside the source tree also names the shipped file: scenes/datasets/tiny.toml
    relative = Path(name)
    if relative.parts[: len(Path(folder).parts)] == Path(folder).parts:
        candidate = shipped(folder) / relative.relative_to(folder)
        if candidate.is_file():
            return candidate
    known = ", ".join(sorted(path.stem for path in shipped(folder).glob("*.toml")))
    raise ValueError(f"{folder}: got {name!r}, no such TOML file; allowed: a path or one of {known}")
