"""A law of the user that is recorded is printed as a law of the registry is: the commands of the core, to the bit."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005
from own_laws import LAWS, skyhook_law
from printed_laws import driven, hostile, printed
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop.printed_loop import printed_loop

OBSERVED = mr.Hardware(feedback="observer", known_ground=True, command_rate=200.0)


@pytest.mark.parametrize(
    "hardware", [mr.Hardware(measured_storeys=(0,)), OBSERVED], ids=["state", "observer"]
)
@pytest.mark.parametrize("name", LAWS)
def test_a_printed_law_of_the_user_sends_the_commands_of_the_core(
    name: str, hardware: mr.Hardware, tmp_path: Path
) -> None:
    law = LAWS[name]()
    if name in ("hysteresis", "pid", "network") and not hardware.measured_storeys:
        pytest.skip("it reads a drift")
    core, source = printed(five_storeys(), devices(rd1005()), hardware, law)
    readings = np.concatenate(
        [np.random.default_rng(5).normal(0.0, 0.1, (500, hostile(core).shape[1])), hostile(core)]
    )
    _, commands = driven(tmp_path, core, source, readings)
    command, _ = commands(True)
    np.testing.assert_array_equal(command, mr._rust.law_commands(core, readings)[:, : core.n_commanded])
    assert command.max() > 0.0 or (name == "one step" and hardware is OBSERVED)
    assert [each.name for each in source.parameters] == [f"{gain.name}[0]" for gain in law.spec.gains]


def test_settings_are_fields_with_units() -> None:
    _, source = printed(five_storeys(), devices(rd1005()), mr.Hardware(), skyhook_law())
    text = source.files[f"{source.name}.h"]
    assert "double gain[1];  /* [A s/m] setting of skyhook, from 0.1 to 100 */" in text
    assert "i = gain |v|" in text


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda sample, memory, settings: max(0.0, sample.rate[0]) * np.ones(2), r"recorded: .*np\.maximum"),
        (lambda sample, memory, settings: sample.time * np.ones(2), "reads the time"),
    ],
)
def test_a_law_that_no_controller_can_have_is_not_printed(function: Callable[..., Any], words: str) -> None:
    law = mr.own_law(function)
    refusal(printed_loop, five_storeys(), devices(rd1005()), law, mr.Hardware(), match=words)
