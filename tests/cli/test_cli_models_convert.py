"""`mrwork models ... --to`: every pair of conventions."""

import json

import pytest
from command_line import printed
from refusals import command_refusal

from mrwork.dampers import damper

SPENCER = ["c0=5000", "k0=2500", "alpha=88e3", "gamma=1e6", "beta=5e5", "A=120", "n=2"]


def parameters(*words: str) -> dict[str, float]:
    found: dict[str, float] = json.loads(printed("models", *words, "--json"))["parameters"]
    return found


def as_arguments(values: dict[str, float]) -> list[str]:
    return [f"{name}={value!r}" for name, value in values.items()]


def test_a_tour_of_the_conventions_ends_where_it_began() -> None:
    material = parameters("spencer", *SPENCER, "--to", "opensees")
    normal = parameters("opensees", *as_arguments(material), "--to", "normalised")
    back = parameters("normalised", *as_arguments(normal), "--to", "spencer")
    given = (5000.0, 2500.0, 0.0, 88e3, 1e6, 5e5, 120.0, 2.0)
    assert back == pytest.approx(dict(zip(damper("bouc_wen").names, given, strict=True)), rel=1e-12)
    rescaled = parameters("spencer", *SPENCER, "--to", "spencer", "--scale", "1")
    assert (rescaled["A"], rescaled["alpha"]) == (1.0, pytest.approx(88e3 * 120.0))


def test_opensees_is_printed_as_its_command_with_the_dashpot_beside_it() -> None:
    text = printed("models", "spencer", *SPENCER, "--to", "opensees")
    material, dashpot = (line.split() for line in text.splitlines() if line.startswith("uniaxialMaterial"))
    assert material[1] == "BoucWen"
    # Spencer's beta is OpenSees' gamma: the smaller of the two stands first.
    assert float(material[6]) == pytest.approx(0.5 * float(material[7]))
    assert dashpot[1] == "Viscous"
    assert float(dashpot[3]) == 5000.0


@pytest.mark.parametrize(
    ("words", "word"),
    [
        (["spencer", *SPENCER, "--to", "normalised", "--error", "0.01"], "--error is of the solver"),
        (["spencer", *SPENCER[1:-1], "--to", "normalised"], "also needs n"),
        (["spencer", *SPENCER], "give --to spencer"),
        (["bouc_wen", *SPENCER, "--to", "normalised"], "the convention of the values is 'bouc_wen'"),
        (["normalised", "k_w=1", "rho=0", "sigma=1", "n=1", "--to", "spencer"], "rho is 0"),
    ],
)
def test_what_cannot_be_converted_is_refused(words: list[str], word: str) -> None:
    command_refusal("models", *words, match=word)
