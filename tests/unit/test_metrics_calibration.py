"""UIQM and UCIQE against values of the public scripts on photographs (printed digits, 0.01).

The photographs are not part of the project; UWSIM_PHOTOS names the folder that holds them. JPEG decoders
differ by one level, which moves the values by less than the tolerance. `uwsim bench restoration --photos` prints the
same differences.
"""

import os
from pathlib import Path

import pytest

from uwsim.bench.photos.calibration import as_published, read_calibration
from uwsim.images import read_srgb
from uwsim.metrics.uiqm import uiqm_f

CALIBRATION = read_calibration()


@pytest.mark.skipif("UWSIM_PHOTOS" not in os.environ, reason="UWSIM_PHOTOS names no folder of photographs")
@pytest.mark.parametrize("known", CALIBRATION.photographs, ids=lambda known: known.name)
def test_photographs(known):
    image = read_srgb(Path(os.environ["UWSIM_PHOTOS"]) / known.name)
    published = known.model_dump(exclude={"name", "origin", "sha256"})
    assert as_published(image, CALIBRATION) == pytest.approx(published, abs=CALIBRATION.tolerance)
    if known.name != "tagtank_000.png":
        # control: the default weight of blue is another number, larger than the tolerance
        assert abs(uiqm_f(image) - known.uiqm_f) > CALIBRATION.tolerance
