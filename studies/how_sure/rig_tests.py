"""The measured tests of this study: thirty sinusoids of one damper, six motions at five currents."""

from __future__ import annotations

from mrwork.records import DamperTest, observed, read_damper_test, repair
from studies.former.records import damper_tests
from studies.former.rig import thinned

MOTIONS = ("25mm0x1Hz", "25mm0x25Hz", "25mm0x5Hz", "10mm1Hz", "5mm3Hz", "2mm5Hz")
CURRENTS = ("0A", "0x25A", "0x5A", "0x75A", "1A")
FITTED = "10mm1Hz"


def rig_test(motion: str, current: str, *, averaged: bool = False) -> DamperTest:
    """One test, thinned, its late velocity derived anew; if `averaged`, with the moving average of its authors."""
    test, _ = repair(read_damper_test(damper_tests() / f"{motion}{current}.csv"), ["velocity"])
    return thinned(observed(test, ["detect"]) if averaged else test)
