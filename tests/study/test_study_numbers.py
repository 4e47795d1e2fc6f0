"""Studies whose numbers are known: a published experiment, a tall building, and the non-causal optimum."""

import numpy as np
import pytest

from mrwork.base.remark import warnings_of
from mrwork.dampers.simulation import Outcome
from mrwork.study import StudyResults, read_study, run_study

N = 40
MASS, STIFFNESS = 3e5, 6e8
TALL = f"""\
[building]
n_storeys = {N}
masses = [{MASS}]
stiffnesses = [{STIFFNESS}]
rayleigh = {{ ratios = [0.02, 0.02], modes = [1, 5] }}

[[damper]]
storey = 1
preset = "kwok2006"
count = 2000

[[damper]]
storey = 2
preset = "kwok2006"
count = 2000

[[controller]]
law = "clipped_optimal"
settings = {{ drifts = 1, control_weight = 1e-15 }}

[[motion]]
synthetic = "kanai_tajimi"
duration = 6
pga = "0.3 g"

[hardware]
sample_time = "5 ms"
step = "2.5 ms"
delay = "5 ms"
feedback = "observer"
measured_floors = [1, 20, 40]
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    path = tmp_path_factory.mktemp("tall") / "study.toml"
    path.write_text(TALL)
    study = read_study(path)
    # Angular frequencies of equal floors on equal springs: 2 sqrt(k/m) sin((2 j - 1) pi / (4 n + 2)).
    orders = np.arange(1, N + 1)
    wanted = 2.0 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * orders - 1) * np.pi / (4 * N + 2))
    assert study.building.frequencies * 2.0 * np.pi == pytest.approx(wanted, rel=1e-9)
    return run_study(study, check_step=True)


def test_every_run_of_forty_storeys_ends_and_its_energies_add_up(results: StudyResults) -> None:
    assert results.complete
    runs = results.quantities
    assert (runs.outcome == Outcome.FINISHED).all()
    assert runs.peak_drift.shape == runs.peak_acceleration.shape == (*runs.shape, N)
    assert (runs.energy_error < 1e-6).all()
    assert warnings_of(results.remarks) == ()


def test_two_dampers_behind_an_observer_take_up_energy_and_lower_the_drift(results: StudyResults) -> None:
    bare, off, controlled = (results.quantities.of_row(row) for row in range(3))
    assert controlled.device_energy.shape[-1] == 2
    assert (controlled.device_energy > off.device_energy).all()
    assert (controlled.rms_current > 0.0).all()
    assert controlled.rms_drift.max() < off.rms_drift.max() < bare.rms_drift.max()


def test_half_the_step_hardly_moves_it(results: StudyResults) -> None:
    for row in range(len(results.rows)):
        changes = results.step_changes(row, 0)
        assert changes is not None
        assert changes["peak_drift"] < 1e-3
