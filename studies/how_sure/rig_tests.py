"""The measured tests of this study: thirty sinusoids of one damper, six motions at five currents."""

from __future__ import annotations

from mrwork.records import DamperTest, cut, observed, read_damper_test, repair
from studies.common.records import damper_tests

MOTIONS = ("25mm0x1Hz", "25mm0x25Hz", "25mm0x5Hz", "10mm1Hz", "5mm3Hz", "2mm5Hz")
CURRENTS = ("0A", "0x25A", "0x5A", "0x75A", "1A")
FITTED = "10mm1Hz"
# Samples of a cycle: with this number the fit of no test changes by more than 0.01.
_PER_CYCLE = 250


def rig_test(motion: str, current: str, *, averaged: bool = False) -> DamperTest:
    """One test, thinned, its late velocity derived anew; if `averaged`, with the moving average of its authors."""
    test, _ = repair(read_damper_test(damper_tests() / f"{motion}{current}.csv"), ["velocity"])
    assert test.frequency is not None
    if averaged:
        test = observed(test, ["detect"])
    return cut(test, every=max(1, int(1.0 / (test.frequency * test.dt * _PER_CYCLE))))
