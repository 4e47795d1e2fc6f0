"""The command line: what it prints, and that every bad input is one sentence and exit 2."""

import json
import sys
from collections.abc import Callable
from inspect import signature
from itertools import product
from pathlib import Path

import pytest
from command_line import COMMAND, mrwork, printed, ran
from refusals import command_refusal
from sentences import Refused
from verb_folders import COMMANDS, written_record

import mrwork as mr
from mrwork.base.hints import Says, nodes_of, note_of
from mrwork.cli.number_texts import Range
from mrwork.plots.of_tests import nominal_loops
from mrwork.runs.exported import export
from mrwork.runs.read_study import read_study
from mrwork.study.fragilities import fragility

FAST = ["--generations", "3", "--quiet"]


@pytest.fixture
def record(tmp_path: Path) -> Path:
    return written_record(tmp_path / "10mm1Hz0x5A.csv", rate=200.0)


def test_models_lists_every_model_and_shows_one_in_full() -> None:
    listed = ran(*COMMAND, "models")
    assert listed.returncode == 0
    for name in ("bouc_wen", "normalised_bouc_wen", "static_hysteretic"):
        assert name in listed.stdout
    assert "Ikhouane" in printed("models", "normalised_bouc_wen")
    classes = [line.partition("  ")[0] for line in printed("models", "--presets").splitlines()[1:11]]
    assert classes == ["up to 100 N", *["up to 10 kN"] * 5, "up to 100 kN", *["up to 1 MN"] * 3]
    (preset,) = json.loads(printed("models", "static_hysteretic", "--presets", "--json"))["presets"]
    assert (preset["name"], preset["rated_force"], preset["force_class"]) == (
        "kwok2006",
        2224.0,
        "up to 10 kN",
    )
    assert "alpha.2" in printed("models", "kwok2006")
    same_name = json.loads(printed("models", "spencer1997", "--json"))["presets"]
    assert [preset["model"] for preset in same_name] == ["bingham", "bouc_wen"]
    document = json.loads(printed("models", "bouc_wen", "--json"))
    assert [parameter["name"] for parameter in document["parameters"]][:2] == ["c0", "k0"]


@pytest.mark.usefixtures("drawn_pictures")
def test_models_draws_the_loops_of_a_model(tmp_path: Path) -> None:
    printed("models", "bingham", "--figure", tmp_path / "figure.svg")
    assert (tmp_path / "figure.svg").read_bytes().startswith(b"<?xml")


def test_check_has_facts_and_remarks_without_fitting(record: Path) -> None:
    assert "0.5 A" in printed("check", record)
    (facts,) = json.loads(printed("check", record, "--json"))["files"]
    assert facts["n_time"] == 400
    assert {"code", "severity", "message", "measured", "words"} == set(facts["remarks"][0])


def test_identify_writes_a_run_that_predict_reads(record: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    model = ("--model", "static_hysteretic", "--seed", "1")
    summary = json.loads(printed("identify", record, *model, "--out", out, "--json", *FAST))
    expected = (
        "model parameters fit_percent nrmse rmse_n error_norms status stop_reason evaluations seconds n_time"
    )
    assert set(expected.split()) <= set(summary)
    assert set(summary["parameters"]["c"]) >= {"value", "unit", "standard_error", "lower", "upper"}
    assert "http://" not in (out / "report.html").read_text().replace("http://www.w3.org", "")
    predicted = json.loads(mrwork("predict", out, record, "--json").stdout)
    assert predicted["files"][0]["fit_percent"] == pytest.approx(summary["fit_percent"], abs=1e-9)
    assert {"file", "fit_percent", "nrmse", "rmse_n", "n_time"} <= set(predicted["files"][0])


def test_a_prediction_observed_otherwise_than_its_fit_says_so(tmp_path: Path, record: Path) -> None:
    out = tmp_path / "run"
    offset = ("--model", "hyperbolic_tangent_guo", "--observe", "offset=each")
    fitted = json.loads(printed("identify", record, *offset, "--out", out, "--json", *FAST))
    as_fitted = json.loads(printed("predict", out, record, "--json"))
    assert (as_fitted["observe"], as_fitted["remarks"]) == (["detect", "offset=each"], [])
    assert as_fitted["files"][0]["fit_percent"] == pytest.approx(fitted["fit_percent"], abs=1e-6)
    assert as_fitted["files"][0]["estimated"]["offset"] != 0.0
    (remark,) = json.loads(printed("predict", out, record, "--observe", "none", "--json"))["remarks"]
    assert (remark["code"], remark["words"]) == ("effects_not_estimated", ["offset of the force"])
    command_refusal("predict", out, record, "--observe", "lag=free", match="leaves lag to a fit")


def test_several_tests_have_a_median_a_worst_and_each_remark_once(tmp_path: Path, record: Path) -> None:
    other, out = tmp_path / "other.csv", tmp_path / "run"
    other.write_bytes(record.read_bytes())
    model = ("--model", "static_hysteretic", "--repair", "offset=100", "--out", out)
    text = printed("identify", record, other, *model, *FAST)
    assert text.count("a static force of +100 N was subtracted") == 1
    found = json.loads(printed("identify", record, other, *model, "--json", "--replace", *FAST))
    fits = [each["fit_percent"] for each in found["files"]]
    assert [each["file"] for each in found["files"]] == [each["test"] for each in found["files"]]
    assert (found["median_fit_percent"], found["worst_fit_percent"]) == (sum(fits) / 2, min(fits))
    predicted = json.loads(printed("predict", out, record, other, "--json"))
    percents = [row["fit_percent"] for row in predicted["files"]]
    assert predicted["spread"]["worst_percent"] == min(percents)
    assert predicted["spread"]["median_percent"] == pytest.approx(sum(percents) / 2)


@pytest.mark.long
def test_identify_starts_from_an_earlier_run(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    test = "synthetic:spencer1997"
    # Two cycles of 50 samples each.
    short = ("--until", "0.8", "--every", "8", "--population", "16", "--quiet")
    printed("identify", test, *short, "--generations", "10", "--out", first)
    printed("identify", test, *short, "--generations", "3", "--start", first, "--out", second)
    one, two = (json.loads((run / "fit.json").read_text()) for run in (first, second))
    assert two["nrmse"] < 1.001 * one["nrmse"]
    (start,) = two["provenance"]["settings"]["starts"]
    assert start == {estimate["name"]: estimate["value"] for estimate in one["estimates"]}
    other = ("--model", "hyperbolic_tangent_guo", "--start", first)
    command_refusal("identify", test, *other, match="shares no parameter")


def test_explicit_columns_and_windows_are_used(tmp_path: Path, record: Path, refused: Refused) -> None:
    other = tmp_path / "rig.csv"
    other.write_text(record.read_text().replace("force_kN", "F", 1))
    refused.command("check", other)
    window = ("--from", "0.5", "--every", "2", "--settle", "0")
    (facts,) = json.loads(printed("check", other, "--column", "force=F:kN", *window, "--json"))["files"]
    assert (facts["n_time"], facts["settle_seconds"]) == (150, 0.0)


def test_other_bad_inputs_are_one_sentence(record: Path, tmp_path: Path, refused: Refused) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    refused.command("check", empty)
    refused.command("identify", record, "--bound", "rho=10:1")
    (empty / "binary.csv").write_bytes(bytes(range(256)) * 20)
    refused.command("identify", empty / "binary.csv", "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()
    refused.command("identify", record, "--column", "force=F:parsec")
    refused.command("identify", record, "--out", "/proc/run")
    refused.command("identify", "synthetic:none")
    refused.command("frobnicate")


def test_options_of_slow_functions_have_their_defaults_ranges_and_meaning() -> None:
    slow: dict[str, tuple[Callable[..., object], ...]] = {
        "models": (nominal_loops,),
        "fragility": (fragility,),
        "export": (export,),
        "respond": (read_study, mr.run_study),
        "tune": (read_study, mr.tune),
        "report": (mr.report.write_page,),
    }
    compared, ranges = 0, 0
    for verb, functions in slow.items():
        for action, function in product(COMMANDS[verb]._actions, functions):
            node = nodes_of(function).get(action.dest)
            if node is None or not (says := note_of(node, Says)):
                continue
            assert (action.help or "").replace("%%", "%").startswith(says.words)
            assert not action.default or action.default == signature(function).parameters[action.dest].default
            compared += 1
            if isinstance(action.type, Range):
                assert action.type == Range.of(next((part for part in node.parts if part.notes), node))
                ranges += 1
    assert (compared, ranges) == (20, 10)


def test_importing_and_asking_for_help_load_nothing_heavy() -> None:
    heavy = {"jax", "matplotlib", "numpy", "scipy", "optimistix", "jinja2", "numba", "pandas", "xarray"}
    heavy |= {"mrwork.base.keys"}
    check = f"import sys; print(sorted({heavy} & set(sys.modules)))"
    imported = ran(sys.executable, "-c", f"import mrwork; {check}", check=True)
    assert imported.stdout.strip() == "[]"
    shows_help = f"from mrwork.cli.door import parser\nparser().format_help()\n{check}"
    helped = ran(sys.executable, "-c", shows_help, check=True)
    assert helped.stdout.strip() == "[]"
    heavy = "{'jax', 'matplotlib', 'scipy', 'emcee', 'h5py', 'optimistix', 'jinja2', 'arviz'}"
    of_verbs = (
        "import sys\nfrom mrwork.cli.door import parser, verbs\nparser(verbs())\n"
        f"print(sorted({heavy} & set(sys.modules)))"
    )
    helped = ran(sys.executable, "-c", of_verbs, check=True)
    assert helped.stdout.strip() == "[]"
