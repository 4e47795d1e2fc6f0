"""The job that every contender of `study.py identify` is given: one record, one model, one box, one misfit.

The non-symmetric Bouc-Wen model, which is the normalised one driven by a velocity with an offset,

    f = c g + k (x - x0) + k_w w,  w' = rho (g - sigma |g| |w|^(n-1) w + (sigma - 1) g |w|^n),  g = v - mu tanh(w/w_s)

with w_s held at 0.1 and the whole offset in the dashpot, as in Kwok et al. (2007): 8 free parameters c, k, x0, k_w,
rho, sigma, n, mu. The misfit is the NRMSE of a free run. All search the unit cube over `search_box` of the record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrwork import synthetic_test
from mrwork.dampers import Box, DamperSpec, damper
from mrwork.errors import RecordError
from mrwork.identification import Objective, search_box
from mrwork.records import DamperTest, cut, read_damper_test
from studies.former.arrays import Floats
from studies.former.records import damper_tests

MODEL = "non_symmetric_bouc_wen"
HELD = {"share": (1.0, 1.0), "w_s": (0.1, 0.1)}
N_TIME = 2000

REFERENCE = "10mm1Hz0x5A"
# The five currents at this amplitude and frequency.
ALL_TESTS = ("10mm1Hz0A", "10mm1Hz0x25A", REFERENCE, "10mm1Hz0x75A", "10mm1Hz1A")
_SYNTHETIC = "rd1005_1a"
_START = 0.5
_EVERY = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchJob:
    """A record, the model and the box that is searched; `objective` is ours, simulated in lanes."""

    test: DamperTest
    spec: DamperSpec
    box: Box
    objective: Objective

    @classmethod
    def of(cls, test: DamperTest, threads: int) -> SearchJob:
        """The job on this record."""
        spec = damper(MODEL)
        return cls(
            test=test,
            spec=spec,
            box=search_box(spec, Box.of(spec).with_bounds(HELD), (test,)),
            objective=Objective.of(spec, (test,), threads=threads),
        )

    @property
    def n_params(self) -> int:
        """Free parameters."""
        return len(self.box.free)

    def theta(self, unit: Floats) -> Floats:
        """Parameters of the model, shape (m, 10), from points of the cube, shape (m, n_params)."""
        return np.asarray(self.box.theta_from_unit(unit))


def record(name: str) -> DamperTest:
    """The measured test of this name, every 4th sample from 0.5 s, 2000 samples.

    Where it is absent, an embedded synthetic test of the same motion and length: 10 mm, 1 Hz, of the static hysteretic
    model, so that no parameters fit it exactly.
    """
    path = damper_tests() / f"{name}.csv"
    if path.is_file():
        test = cut(read_damper_test(path, keep_velocity=True), start=_START, every=_EVERY)
    else:
        test = cut(synthetic_test(_SYNTHETIC), every=2)
    if test.n_time < N_TIME:
        raise RecordError(
            f"{test.path}: {test.n_time} samples remain, the job takes {N_TIME}; use a longer record"
        )
    return cut(test, end=test.start_time + (N_TIME - 0.5) * test.dt)
