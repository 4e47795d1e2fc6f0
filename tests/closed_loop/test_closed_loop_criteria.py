"""Evaluation criteria: what each is, and the ratios that papers make of them."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005, sweep

from mrwork.closed_loop import criteria, simulate_loop
from mrwork.closed_loop.evaluation import SCORE, Scales, ratio, values
from mrwork.closed_loop.responses import history_signals, run_quantities
from mrwork.control import ControlLaw

SCALES = Scales(weight=10.0, heights=np.array([3.0, 4.0, 5.0]))


def responses(n_runs: int, n_devices: int = 2) -> Any:
    """Every quantity of runs of a building with three floors."""
    rng = np.random.default_rng(3)
    shapes = {"run": (n_runs,), "floor": (n_runs, 3), "storey": (n_runs, 3), "device": (n_runs, n_devices)}
    shapes["element"] = (n_runs, 1)
    return SimpleNamespace(
        **{quantity.name: rng.uniform(1.0, 2.0, shapes[quantity.axis]) for quantity in run_quantities()}
    )


def row(of: Any, run: int) -> Any:
    return SimpleNamespace(**{name: array[run] for name, array in vars(of).items()})


def test_criteria_of_a_batch_are_those_of_its_runs() -> None:
    batch = responses(4)
    together = values(batch, SCALES)
    for run in range(4):
        for name, value in values(row(batch, run), SCALES).items():
            np.testing.assert_array_equal(value, together[name][run])


def test_the_drift_ratio_is_that_of_the_worst_storey_over_its_own_height() -> None:
    batch = responses(1)
    batch.peak_drift[0] = [0.03, 0.02, 0.5]
    # The last row is no storey.
    assert (
        values(batch, Scales(weight=1.0, heights=np.array([6.0, 2.5, 0.0])))["peak_drift_ratio"][0]
        == 0.02 / 2.5
    )
    assert np.isnan(values(batch, Scales(weight=1.0))["peak_drift_ratio"][0])


def test_ductility_and_stability_are_those_of_the_worst_storey_that_has_them() -> None:
    batch = responses(1)
    batch.peak_drift[0], batch.peak_storey_shear[0] = [0.03, 0.02, 0.1], [1e5, 5e4, 2e4]
    scales = Scales(
        weight=1.0,
        heights=np.array([3.0, 4.0, 5.0]),
        yield_drifts=np.array([0.01, 0.02, 0.0]),
        loads=np.array([3e5, 2e5, 0.0]),
    )
    found = values(batch, scales)
    assert found["peak_ductility"][0] == pytest.approx(3.0)
    assert found["stability_coefficient"][0] == pytest.approx(3e5 * 0.03 / (1e5 * 3.0))
    assert np.isnan(values(batch, SCALES)["peak_ductility"][0])


def test_the_largest_floor_or_device_counts() -> None:
    batch = responses(1)
    batch.peak_drift[0] = [0.1, 0.3, 0.2]
    batch.peak_force[0] = [50.0, 20.0]
    found = values(batch, Scales(weight=1000.0))
    assert found["peak_drift"][0] == 0.3
    assert found["peak_force_share"][0] == 0.05


def test_a_building_without_devices_has_no_device_force() -> None:
    found = values(responses(2, n_devices=0), Scales(weight=10.0))
    assert found["peak_force"].tolist() == [0.0, 0.0]
    assert np.isnan(ratio(found["peak_force"], found["peak_force"])).all()


def test_names_are_unique_and_labels_name_their_paper() -> None:
    names = [entry.name for entry in criteria()]
    assert len(set(names)) == len(names)
    labels = [label for entry in criteria() for label in entry.labels]
    assert len(set(labels)) == len(labels)
    assert {entry.reference_criterion for entry in criteria()} - {""} <= set(names)
    assert set(SCORE) <= {entry.name for entry in criteria() if entry.ratio}
    units = {entry.name: entry.unit for entry in criteria()}
    assert (units["peak_drift"], units["peak_acceleration"], units["device_energy"]) == ("m", "m/s2", "J")


def test_the_names_of_a_result_are_those_that_the_core_declares() -> None:
    law = ControlLaw(name="passive", gains={"command": np.ones((1, 2))})
    found = simulate_loop(five_storeys(), devices(rd1005()), law, [sweep(0.2)], histories=True)
    assert list(found.numbers) == [each.name for each in run_quantities()]
    assert list(found.histories[0].numbers) == [each.name for each in history_signals()]
    for name, array in found.numbers.items():
        np.testing.assert_array_equal(getattr(found, name), array)
        assert name in dir(found)
