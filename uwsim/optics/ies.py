"""Photometric files of lamp makers: IES LM-63-1991 to LM-63-2019, TILT=NONE, type C.

A strict parser: what it does not know it refuses, in one line that names the file, the line and what is allowed.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_LM_63_2019 = "IES:LM-63-2019"
FORMATS = ("IESNA91", "IESNA:LM-63-1991", "IESNA:LM-63-1995", "IESNA:LM-63-2002", _LM_63_2019)
_MOST = 100_000
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_HEADER_NUMBERS = 13
_AXIAL, _QUADRANT, _BILATERAL, _FULL = 0.0, 90.0, 180.0, 360.0


@dataclass(frozen=True)
class Photometry:
    """Luminous intensity of a lamp whose axis is vertical angle 0.

    `vertical_deg` (v,), `horizontal_deg` (h,), `intensity_cd` (h, v) with every factor of the file applied.
    Horizontal angles that end at 0, 90, 180 or 360 stand for an axial, quadrant, bilateral or no symmetry.
    `keywords` hold the bracketed lines; `luminous_flux_lm` is the bare lamp's, None in absolute photometry.
    """

    vertical_deg: np.ndarray
    horizontal_deg: np.ndarray
    intensity_cd: np.ndarray
    keywords: dict[str, str]
    luminous_flux_lm: float | None

    def intensity(self, vertical_deg: np.ndarray, horizontal_deg: np.ndarray) -> np.ndarray:
        """Return the intensity at angles (...), bilinear between the file's, 0 outside its vertical range. [cd]"""
        vertical, turn = np.broadcast_arrays(np.asarray(vertical_deg, float), np.asarray(horizontal_deg, float))
        folded = _folded(turn, self.horizontal_deg[-1])
        upper = np.clip(np.searchsorted(self.horizontal_deg, folded), 1, max(len(self.horizontal_deg) - 1, 1))
        low, high = (upper - 1, upper) if len(self.horizontal_deg) > 1 else (upper - 1, upper - 1)
        span = self.horizontal_deg[high] - self.horizontal_deg[low]
        share = np.where(span > 0, (folded - self.horizontal_deg[low]) / np.where(span > 0, span, 1), 0.0)
        planes = np.stack([np.interp(vertical, self.vertical_deg, row, left=0, right=0) for row in self.intensity_cd])
        near = np.take_along_axis(planes, low[None], axis=0)[0]
        far = np.take_along_axis(planes, high[None], axis=0)[0]
        return (1 - share) * near + share * far

    def emitted_flux_lm(self) -> float:
        """Return the luminous flux that leaves the lamp: the integral of the intensity over the sphere. [lm]"""
        vertical = np.radians(np.linspace(0, 180, 1801))
        horizontal = np.arange(0.5, 360.0)
        mean = self.intensity(np.degrees(vertical)[:, None], horizontal).mean(axis=1)
        return float(2 * np.pi * np.trapezoid(mean * np.sin(vertical), vertical))


def _folded(horizontal_deg: np.ndarray, last_deg: float) -> np.ndarray:
    """Return horizontal angles mirrored into the range that a symmetric file tabulates."""
    turn = np.mod(horizontal_deg, 360.0)
    if last_deg == _FULL:
        return turn
    half = np.where(turn > 180, 360 - turn, turn)
    if last_deg == _BILATERAL:
        return half
    return np.where(half > 90, 180 - half, half) if last_deg == _QUADRANT else np.zeros_like(turn)


def read(path: Path) -> Photometry:
    """Return the photometry of an IES file.

    Raises ValueError in one line naming the file for another format or photometric type, a lamp tilt, numbers that
    are not numbers, counts that do not fit, and angles that do not increase.
    Source: ANSI/IESNA LM-63-2002 (13 numbers, vertical angles, horizontal angles, one run of candelas per plane).
    In LM-63-2019 the 12th number tells how the file was made and multiplies nothing.
    """
    path = Path(path)
    content = path.read_bytes()
    encoding = "utf-8-sig" if content.startswith(b"\xef\xbb\xbf") else "latin-1"
    return parse(content.decode(encoding, errors="replace"), where=path.name)


def parse(text: str, *, where: str) -> Photometry:
    """Return the photometry of the text of an IES file; `where` names it in errors."""
    lines = text.removeprefix("\ufeff").rstrip().removesuffix("\x1a").splitlines()
    if not lines or lines[0].strip() not in FORMATS:
        got = lines[0].strip()[:40] if lines else ""
        raise ValueError(f"{where}: first line: got {got!r}, allowed: {' or '.join(FORMATS)}")
    start = next((i for i, line in enumerate(lines) if re.match(r"\s*TILT\s*=", line)), None)
    if start is None:
        raise ValueError(f"{where}: no line TILT=, allowed: TILT=NONE")
    if not re.fullmatch(r"TILT\s*=\s*NONE", tilt := lines[start].strip()):
        raise ValueError(f"{where}: got {tilt[:40]}, allowed: TILT=NONE")
    numbers = _numbers(lines[start + 1 :], first_line=start + 2, where=where)
    has_factor = lines[0].strip() != _LM_63_2019
    return _photometry(numbers, _keywords(lines[1:start]), has_second_factor=has_factor, where=where)


def _keywords(lines: list[str]) -> dict[str, str]:
    """Return the bracketed keywords; [MORE] continues the line before."""
    found: dict[str, str] = {}
    last = None
    for line in lines:
        match = re.match(r"\s*\[([^\]]+)\]\s*(.*)", line)
        if not match:
            continue
        name, value = match[1].strip(), match[2].strip()
        if name == "MORE" and last:
            found[last] += f"\n{value}"
        else:
            found[name], last = value, name
    return found


def _numbers(lines: list[str], *, first_line: int, where: str) -> np.ndarray:
    found = []
    for row, line in enumerate(lines, first_line):
        for word in re.split(r"[,\s]+", line.strip()):
            if not word:
                continue
            if not _NUMBER.fullmatch(word):
                raise ValueError(f"{where}: line {row}: got {word[:40]!r}, allowed: a number")
            found.append(float(word))
    if not np.all(np.isfinite(found)):
        raise ValueError(f"{where}: a number is too large, allowed: finite numbers")
    return np.asarray(found)


def _count(value: float, name: str, where: str) -> int:
    if value != int(value) or not 1 <= value <= _MOST:
        raise ValueError(f"{where}: {name}: got {value:g}, allowed: a whole number from 1 to {_MOST}")
    return int(value)


def _photometry(
    numbers: np.ndarray, keywords: dict[str, str], *, has_second_factor: bool, where: str
) -> Photometry:  # fmt: skip
    if len(numbers) < _HEADER_NUMBERS:
        raise ValueError(f"{where}: got {len(numbers)} numbers after TILT, allowed: at least {_HEADER_NUMBERS}")
    lamps, lumens, multiplier, vertical, horizontal, kind = numbers[:6]
    ballast, second_factor = numbers[10], numbers[11] if has_second_factor else 1.0
    if kind != 1:
        raise ValueError(f"{where}: photometric type: got {kind:g}, allowed: 1 (type C)")
    lamps = _count(lamps, "number of lamps", where)
    v, h = _count(vertical, "vertical angles", where), _count(horizontal, "horizontal angles", where)
    expected = _HEADER_NUMBERS + v + h + v * h
    if len(numbers) != expected:
        raise ValueError(
            f"{where}: got {len(numbers)} numbers after TILT, allowed: {expected} "
            f"(13 + {v} vertical + {h} horizontal angles + {v} x {h} intensities)"
        )
    for name, factor in (("multiplier", multiplier), ("ballast factor", ballast), ("second factor", second_factor)):
        if factor <= 0:
            raise ValueError(f"{where}: {name}: got {factor:g}, allowed: above 0")
    angles_v, angles_h = numbers[_HEADER_NUMBERS:][:v], numbers[_HEADER_NUMBERS + v :][:h]
    intensity = numbers[_HEADER_NUMBERS + v + h :].reshape(h, v)
    _check_angles(angles_v, angles_h, where=where)
    if np.any(intensity < 0):
        raise ValueError(f"{where}: intensities: got {intensity.min():g}, allowed: at least 0")
    return Photometry(
        vertical_deg=angles_v,
        horizontal_deg=angles_h,
        intensity_cd=intensity * multiplier * ballast * second_factor,
        keywords=keywords,
        luminous_flux_lm=_flux(lamps, lumens, where=where),
    )


def _flux(lamps: int, lumens: float, *, where: str) -> float | None:
    if lumens == -1:  # absolute photometry
        return None
    if lumens <= 0:
        raise ValueError(f"{where}: lumens per lamp: got {lumens:g}, allowed: above 0, or -1 (absolute photometry)")
    return lamps * lumens


def _check_angles(vertical: np.ndarray, horizontal: np.ndarray, *, where: str) -> None:
    for name, angles in (("vertical angles", vertical), ("horizontal angles", horizontal)):
        if not np.all(np.diff(angles) > 0):
            raise ValueError(f"{where}: {name}: got angles out of order, allowed: strictly increasing")
    if (vertical[0], vertical[-1]) not in ((0, 90), (0, 180), (90, 180)):
        got = f"{vertical[0]:g} to {vertical[-1]:g}"
        raise ValueError(f"{where}: vertical angles: got {got}, allowed in type C: 0 to 90, 0 to 180 or 90 to 180")
    if horizontal[0] != 0 or horizontal[-1] not in (_AXIAL, _QUADRANT, _BILATERAL, _FULL):
        got = f"{horizontal[0]:g} to {horizontal[-1]:g}"
        raise ValueError(f"{where}: horizontal angles: got {got}, allowed: from 0 to 0, 90, 180 or 360")
