"""A law of the user with memory and settings by name goes wherever a law of the registry goes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005, sweep
from own_laws import LAWS, skyhook, skyhook_law
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, Responses
from mrwork.dampers.simulation import Outcome

BROKEN = Fault(channel="force", index=0, start=0.2, end=0.3, value=np.nan)
# How near the numbers of Python are: exp, tanh and the order of sums are others.
NEAR = dict.fromkeys(("network", "kalman", "one step", "energy", "phase"), 1e-12)


def run(law: mr.ControlLaw, hardware: Hardware | None = None, **settings: Any) -> Responses:
    hardware = hardware or Hardware(measured_storeys=(0,))
    loop = devices(rd1005(), second=True)
    return mr.simulate_loop(
        five_storeys(), loop, law, [sweep(0.4), sweep(0.4, peak=4.0)], hardware, **settings
    )


@pytest.mark.parametrize(
    "hardware",
    [
        Hardware(measured_storeys=(0,)),
        Hardware(measured_storeys=(0,), feedback="observer", delay=2e-3, force_noise=1.0, faults=(BROKEN,)),
    ],
    ids=["plain", "observer, delay, noise and a fault"],
)
@pytest.mark.parametrize("name", LAWS)
def test_a_recorded_law_has_the_numbers_of_its_function(name: str, hardware: Hardware) -> None:
    found, expected = (run(LAWS[name](record=record), hardware) for record in (True, False))
    np.testing.assert_array_equal(found.outcome, expected.outcome)
    for quantity in ("peak_drift", "rms_acceleration", "mean_current", "device_energy", "command_travel"):
        mine, its = getattr(found, quantity), getattr(expected, quantity)
        np.testing.assert_allclose(mine, its, rtol=NEAR.get(name, 0.0))
    assert found.mean_current.max() > 0.0
    assert found.law_remarks == ()


def test_settings_are_those_of_candidates() -> None:
    law = skyhook_law(record=True)
    many = run(replace(law, gains={"gain": [[1.0], [6.0], [50.0]], "corner": [0.3]}), threads=2)
    assert many.shape == (3, 2, 1)
    np.testing.assert_array_equal(many.peak_drift[2:4], run(law).peak_drift)
    other = replace(law, gains={"gain": [50.0], "corner": [0.3]})
    np.testing.assert_array_equal(many.peak_drift[4:], run(other).peak_drift)
    assert np.unique(many.mean_current[::2, 0]).size == 3


def test_a_dead_zone_and_a_slope_go_with_it() -> None:
    law = replace(skyhook_law(), dead_zone=0.05, command_slope=5.0)
    found = run(law, histories=True).histories[0]
    assert np.abs(np.diff(found.command[:, 0])).max() <= 5e-3 + 1e-12


def test_its_specification_is_that_of_a_law() -> None:
    law = skyhook_law()
    assert law.spec.title == "skyhook"
    assert law.spec.equation.startswith("i = gain |v|")
    assert [(gain.name, gain.unit) for gain in law.spec.gains] == [("corner", "Hz"), ("gain", "A s/m")]
    assert law.spec is mr.control.control_law(law.name)
    assert law == skyhook_law()
    assert (
        law.name
        != mr.own_law(skyhook, memory={"v": 0.0, "x": 0.0}, settings={"corner": ("Hz", 0.1, 0.3, 2.0)}).name
    )


def forgets(sample: Any, memory: Any, settings: Any) -> Any:
    memory.x = sample.rate
    return np.abs(sample.rate)


def invents(sample: Any, memory: Any, settings: Any) -> Any:
    memory.y = sample.rate
    return np.abs(sample.rate)


def branches(sample: Any, memory: Any, settings: Any) -> Any:
    return np.abs(sample.rate) if sample.rate[0] > 0.0 else 0.0 * sample.rate


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (forgets, r"memory\.x has shape \(\) at first and \(2,\) after"),
        (invents, r"memory\.y is not declared; the memory has x"),
    ],
)
def test_a_wrong_memory_is_told(function: Callable[..., Any], words: str) -> None:
    refusal(run, mr.own_law(function, memory={"x": 0.0}), match=words)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"gain": ("", 0.0, 1.0, 2.0)}, "no unit"),
        ({"gain": ("1", 3.0, 1.0, 2.0)}, "that rise"),
        ({"gain": ("1", 0.0, 5.0, 2.0)}, "that rise"),
        ({"a gain": ("1", 0.0, 1.0, 2.0)}, "a name of letters"),
        ({"weights": ("1", 0.0, 1.0, 2.0)}, "weights is no name of a setting of skyhook; give another one"),
        ({"gain": ("1", 0.0, [1.0, 5.0], 2.0)}, "nominally 5; .* that rise"),
        ({"gain": ("1", 0.0, [], 2.0)}, "nominally nothing; .* that rise"),
    ],
)
def test_a_wrong_setting_is_refused(settings: dict[str, Any], words: str) -> None:
    refusal(mr.own_law, skyhook, settings=settings, match=words)


def test_what_cannot_be_recorded_runs_in_python_and_says_why() -> None:
    found = run(mr.own_law(branches))
    (remark,) = found.law_remarks
    assert remark.code == "law_in_python"
    assert "np.where" in remark.message
    refusal(run, mr.own_law(branches, record=True), match="branches cannot be recorded: .*line")


def test_a_force_that_is_no_number_is_no_command() -> None:
    found = run(LAWS["energy"](), Hardware(faults=(BROKEN,)))
    assert set(found.outcome) == {Outcome.FAILED_SAFE}
