"""Every search of the registry identifies a damper, by its name alone."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import printed
from sentences import Refused

import mrwork as mr
from mrwork.identification import FitSettings
from mrwork.identification.settings import search_named, searches

TEST = mr.synthetic_test("rd1005_1a")


@pytest.mark.parametrize("name", searches())
def test_a_search_is_chosen_by_name_and_recorded(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    size = [] if name == "multistart" else ["--generations", "25"]
    arguments = ["synthetic:rd1005_1a", "--model", "dahl", "--every", "4", "--search", name, *size]
    found = json.loads(printed(capsys, "identify", *arguments, "--json", "--out", tmp_path / "run"))
    assert found["fit_percent"] > 75.0
    fit = json.loads((tmp_path / "run" / "fit.json").read_text())
    assert fit["provenance"]["settings"]["search"]["kind"] == name
    settings = FitSettings.of_record(fit["provenance"]["settings"])
    assert type(settings.search) is type(search_named(name))


def test_python_takes_the_name_too() -> None:
    fit = mr.identify("dahl", TEST, search="multistart")
    assert fit.settings.search == search_named("multistart")


def test_an_unknown_search_is_refused_with_those_there_are(refused: Refused) -> None:
    refused(mr.identify, "dahl", TEST, search="annealing")
