"""`mrwork convert`: every pair of conventions, and every bad input one sentence and exit 2."""

from __future__ import annotations

import json
import re

import pytest
from command_line import mrwork
from sentences import Refused

from mrwork.dampers import damper

SPENCER = ["c0=5000", "k0=2500", "alpha=88e3", "gamma=1e6", "beta=5e5", "A=120", "n=2"]


def convert(*arguments: str) -> tuple[object, str, str]:
    """Run the verb in this process: exit status, stdout, stderr."""
    ended = mrwork("convert", *arguments)
    return ended.returncode, ended.stdout, ended.stderr


def parameters(result: tuple[object, str, str]) -> dict[str, float]:
    status, stdout, stderr = result
    assert (status, stderr) == (0, "")
    return json.loads(stdout)["parameters"]


def as_arguments(values: dict[str, float]) -> list[str]:
    return [f"{name}={value!r}" for name, value in values.items()]


def test_a_tour_of_the_conventions_ends_where_it_began() -> None:
    material = parameters(convert("spencer", *SPENCER, "--to", "opensees", "--json"))
    normal = parameters(convert("opensees", *as_arguments(material), "--to", "normalised", "--json"))
    back = parameters(convert("normalised", *as_arguments(normal), "--to", "spencer", "--json"))
    given = dict(
        zip(damper("bouc_wen").names, (5000.0, 2500.0, 0.0, 88e3, 1e6, 5e5, 120.0, 2.0), strict=True)
    )
    assert back == pytest.approx(given, rel=1e-12)


def test_scale_chooses_a_without_a_change_of_force() -> None:
    rescaled = parameters(convert("spencer", *SPENCER, "--to", "spencer", "--scale", "1", "--json"))
    assert rescaled["A"] == 1.0
    assert rescaled["alpha"] == pytest.approx(88e3 * 120.0)
    one, other = (
        parameters(convert("spencer", *arguments, "--to", "normalised", "--json"))
        for arguments in (SPENCER, as_arguments(rescaled))
    )
    assert one == pytest.approx(other, rel=1e-12)


def test_opensees_is_printed_as_its_command_with_the_dashpot_beside_it() -> None:
    status, stdout, _ = convert("spencer", *SPENCER, "--to", "opensees")
    assert status == 0
    material, dashpot = (line.split() for line in stdout.splitlines() if line.startswith("uniaxialMaterial"))
    assert material[1] == "BoucWen"
    # Spencer's beta is OpenSees' gamma: the smaller of the two stands first.
    assert float(material[6]) == pytest.approx(0.5 * float(material[7]))
    assert dashpot[1] == "Viscous"
    assert float(dashpot[3]) == 5000.0
    assert "note: the factors" in stdout


def test_a_smaller_error_wants_a_smaller_strain_step_in_opensees() -> None:
    def remark(*error: str) -> str:
        _, stdout, _ = convert("spencer", *SPENCER, "--to", "opensees", "--json", *error)
        return json.loads(stdout)["remarks"][-1]

    assert remark() == remark("--error", "0.005")
    assert "0.5 %" in remark()
    step, finer = (
        float(re.search(r"at most (\S+) m", remark("--error", error))[1]) for error in ("0.01", "0.001")
    )
    assert step == pytest.approx(10.0 * finer, rel=0.01)


def test_bad_input_is_one_sentence(refused: Refused) -> None:
    for arguments in (
        ["spencer", *SPENCER, "--to", "normalised", "--error", "0.01"],
        ["spencer", *SPENCER, "--to", "spencer"],
        ["spencer", *SPENCER[1:-1], "--to", "normalised"],
        ["spencer", *SPENCER, "n=3", "--to", "normalised"],
        ["spencer", *SPENCER, "ko=3", "--to", "normalised"],
        ["spencer", *SPENCER, "x0", "--to", "normalised"],
        ["spencer", *SPENCER, "x0=nan", "--to", "normalised"],
        ["spencer", *SPENCER, "--to", "normalised", "--scale", "3"],
        ["spencer", *SPENCER, "--to", "opensees", "--scale", "-3"],
        ["normalised", "k_w=1", "rho=0", "sigma=1", "n=1", "--to", "spencer"],
        [
            "opensees",
            "ko=1",
            "alpha=.1",
            "n=1",
            "gamma=1",
            "beta=1",
            "Ao=1",
            "deltaA=1",
            "--to",
            "spencer",
        ],
        ["opensees", "ko=1", "--to", "abaqus"],
    ):
        refused.command("convert", *arguments)
