"""A parameter has one verdict and one standard error: in the terminal, in JSON, in the files and in Python."""

import json
from pathlib import Path

import pytest
from command_line import printed
from record_files import write_test
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.identification.fit_file import reopen

pytestmark = pytest.mark.usefixtures("pages")

DAMPER = {"k_x": 4000.0, "k_w": 600.0, "rho": 5000.0}


SYNTHETIC = ("synthetic:spencer1997_fast", "--every", "4")
DAHL, BOUC_WEN = (*SYNTHETIC, "--model", "viscous_dahl"), (*SYNTHETIC, "--model", "bouc_wen")
# A command line of `identify`, the noise of a record of its own, and the verdicts that it must give.
CASES: dict[str, tuple[tuple[str, ...], float, dict[str, str]]] = {
    "well determined": (DAHL, 0.0, {"k_w": "identifiable", "f0": "identifiable"}),
    "at its bound": (
        (*DAHL, "--bound", "rho=10:2000"),
        0.0,
        {"rho": "weakly identifiable", "k_w": "model-dependent"},
    ),
    "irrelevant": (("--model", "viscous_dahl"), 0.01, {"f0": "negligible", "k_w": "identifiable"}),
    "unknown sign": (("--model", "viscous_dahl"), 0.4, {"f0": "sign unknown", "k_w": "identifiable"}),
    "a common scale": (BOUC_WEN, 0.0, {"A": "fixed", "alpha": "identifiable"}),
    "at its bound in another form": (
        (*BOUC_WEN, "--bound", "n=2.5:4"),
        0.0,
        {"A": "fixed", "n": "weakly identifiable"},
    ),
    "an enormous error": (
        ("synthetic:rd1005_1a", "--every", "4", "--model", "maxwell"),
        0.0,
        {"k": "weakly identifiable", "f0": "sign unknown"},
    ),
    "springs that can hardly be told apart": (
        ("synthetic:spencer1997", "--every", "8", "--model", "modified_bouc_wen"),
        0.0,
        {"k0": "weakly identifiable", "k1": "sign unknown", "c1": "weakly identifiable"},
    ),
}


def record(folder: Path, noise: float) -> str:
    """A record of a damper without an offset."""
    test = sinusoidal_test("viscous_dahl", (*DAMPER.values(), 0.0), (0.01, 1.0), noise=noise, rng=3)
    return str(write_test(folder / "record.csv", test))


def rows_of(text: str) -> dict[str, str]:
    """Lines of the first table of an output, by the name of the parameter."""
    table = text.partition("  parameter ")[2].split("\n\n")[0].splitlines()[1:]
    return {line.split()[0]: line for line in table}


def check_one_verdict(place: Path, terminal: str) -> dict[str, str]:
    """The verdicts of a run, after checking that they are the same everywhere."""
    fit = mr.load(place).fit
    verdicts = {each.name: each.verdict.word for each in fit.estimates}
    stored = json.loads((place / "fit.json").read_text())["estimates"]
    for each, own in zip(fit.estimates, stored, strict=True):
        assert own["standard_error"] == each.standard_error
        assert fit.an_interval is not None or own["verdict"]["word"] == each.verdict.word
        # 0 was once that of a parameter at its bound.
        assert each.standard_error is None or each.standard_error > 0.0
        if each.state:
            assert each.standard_error is None
    words = {line: verdicts[name] for name, line in rows_of(terminal).items() if name in verdicts}
    assert all(f"  {verdict}" in line for line, verdict in words.items())
    page = (place / "report.html").read_text()
    for name, verdict in verdicts.items():
        if verdict in ("identifiable", "negligible"):
            # "identifiable" above and "1.16e6 times its value" below.
            assert f"the standard error of {name} is" not in terminal
            assert f"the standard error of {name} is" not in page
    return verdicts


@pytest.mark.long
@pytest.mark.parametrize(("given", "noise", "expected"), CASES.values(), ids=CASES)
def test_verdicts_and_errors_are_the_same_everywhere(
    given: tuple[str, ...], noise: float, expected: dict[str, str], tmp_path: Path
) -> None:
    place = tmp_path / "run"
    arguments = (record(tmp_path, noise), *given) if noise else given
    command = ("identify", *arguments, "--seed", "1", "--json", "--threads", "1", "--out", place)
    document = json.loads(printed(*command))
    opened = reopen(place)
    # What the command prints without --json.
    verdicts = check_one_verdict(place, opened.fit._summary().text(whole=True))
    assert expected.items() <= verdicts.items()
    assert {key: each["verdict"] for key, each in document["parameters"].items()} == verdicts
    for each in document["parameters"].values():
        assert (each["standard_error"] is None) or not each["state"]


@pytest.mark.parametrize("model", ["viscous_dahl", "bouc_wen"])
def test_python_returns_the_numbers_that_the_command_prints(model: str, tmp_path: Path) -> None:
    name = "spencer1997_fast"
    fit = mr.identify(model, mr.records.cut(mr.synthetic_test(name), every=4), rng=1, threads=1)
    command = ("identify", f"synthetic:{name}", "--every", "4", "--model", model, "--seed", "1", "--json")
    document = json.loads(printed(*command, "--threads", "1", "--out", tmp_path / "run"))
    assert document["parameters"] == fit.document()["parameters"]
    assert all(each.verdict.word for each in fit.estimates)


@pytest.mark.long
def test_later_intervals_bring_their_verdicts_everywhere(tmp_path: Path) -> None:
    place = tmp_path / "run"
    path = record(tmp_path, 0.4)
    printed("identify", path, "--model", "dahl", "--seed", "1", "--quiet", "--out", place)
    whole = printed("intervals", place, "--quiet")
    assert "stay those" not in whole
    assert check_one_verdict(place, whole)["f0"] == "sign unknown"
    assert mr.load(place).fit.an_interval is not None
    drawn = printed(
        "intervals", place, "--posterior", "--quiet", "--walkers", "32", "--steps", "6000", "--seed", "1"
    )
    kind = mr.load(place).fit.an_interval
    assert kind is not None
    assert kind.kind == "posterior", drawn
    assert check_one_verdict(place, drawn)["f0"] == "sign unknown"
    # The draws come first; profiles say so.
    after = printed("intervals", place, "--quiet", "--parameter", "k_w")
    assert "verdicts of the fit, and of its page, stay those by its 95 % posterior inter" in after
    check_one_verdict(place, "")
