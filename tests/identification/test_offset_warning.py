"""An offset of the force that a model describes asks for nothing; one that it cannot is a warning with what to do."""

from __future__ import annotations

import json

import pytest
from command_line import mrwork

TEST = "synthetic:spencer1997_fast"


@pytest.mark.parametrize(
    ("arguments", "warned"),
    [
        (("--model", "dahl"), False),
        (("--model", "dahl", "--fix", "f0=0"), True),
        (("--model", "dahl", "--fix", "f0=-90"), False),
        (("--model", "dahl", "--nuisance", "offset"), False),
        (("--model", "dahl", "--fix", "f0=0", "--repair", "offset"), False),
    ],
)
def test_only_an_offset_that_the_model_cannot_describe_is_a_warning(
    arguments: tuple[str, ...], warned: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    place = tmp_path_factory.mktemp("offset") / "run"
    ended = mrwork("identify", TEST, "--every", "8", *arguments, "--json", "--out", place)
    assert ended.returncode == 0, ended.stderr
    document = json.loads(ended.stdout)
    about = [each for each in document["warnings"] if "static offset" in each]
    assert bool(about) == warned
    if warned:
        assert "f0 is fixed at 0" in about[0]
        assert "--repair offset" in about[0]
    severities = {each["code"]: each["severity"] for each in document["findings"]}
    assert severities.get("force_offset") == (None if "--repair" in arguments else "note")


def test_the_first_demo_has_no_warning(tmp_path_factory: pytest.TempPathFactory) -> None:
    place = tmp_path_factory.mktemp("demo") / "run"
    model = ("--model", "normalised_bouc_wen", "--seed", "1")
    ended = mrwork("identify", "synthetic:spencer1997", *model, "--quiet", "--out", place)
    assert ended.returncode == 0, ended.stderr
    assert "warning" not in ended.stdout + ended.stderr
    assert "note: the force has a static offset" in ended.stdout
