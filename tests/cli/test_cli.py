"""The command line: what it prints, and that every bad input is one sentence and exit 2."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import pytest
from command_line import COMMAND, PATIENCE, mrwork, printed, ran, started, wait_until
from sentences import Refused
from verb_folders import written_record

FAST = ["--generations", "3", "--quiet"]


@pytest.fixture
def record(tmp_path: Path) -> Path:
    return written_record(tmp_path / "10mm1Hz0x5A.csv", rate=200.0)


def test_models_lists_every_model_and_shows_one_in_full() -> None:
    listed = ran(*COMMAND, "models")
    assert listed.returncode == 0
    for name in ("bouc_wen", "normalised_bouc_wen", "static_hysteretic"):
        assert name in listed.stdout
    shown = mrwork("models", "normalised_bouc_wen").stdout
    for word in ("w' = rho", "Ikhouane", "k_w", "1/m", "lower", "upper"):
        assert word in shown
    document = json.loads(mrwork("models", "bouc_wen", "--json").stdout)
    assert [parameter["name"] for parameter in document["parameters"]][:2] == ["c0", "k0"]


@pytest.mark.usefixtures("drawn_pictures")
@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_models_draws_the_effect_of_every_parameter(tmp_path: Path, suffix: str) -> None:
    place = tmp_path / f"figure{suffix}"
    text = printed("models", "bingham", "--figure", place)
    assert str(place) in text
    assert place.read_bytes().startswith(b"<?xml" if suffix == ".svg" else b"\x89PNG")


def test_models_draws_one_model_in_a_known_form(tmp_path: Path, refused: Refused) -> None:
    for arguments in (["--figure", tmp_path / "a.svg"], ["bingham", "--figure", tmp_path / "a.pdf"]):
        refused.command("models", *arguments)
    assert list(tmp_path.iterdir()) == []


def test_check_prints_the_findings_without_fitting(record: Path) -> None:
    text = printed("check", record)
    assert "0.5 A" in text
    assert "velocity" in text
    (facts,) = json.loads(mrwork("check", record, "--json").stdout)["files"]
    assert facts["n_time"] == 400
    assert {"code", "severity", "message", "measured"} == set(facts["findings"][0])


def test_check_carries_its_estimates_as_numbers(tmp_path: Path, record: Path) -> None:
    raised = tmp_path / "raised.csv"
    head, *rows = record.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    raised.write_text("\n".join([head, *(f"{t},{x},{float(f) + 0.2:.9f}" for t, x, f in cells)]) + "\n")
    (facts,) = json.loads(mrwork("check", raised, "--json").stdout)["files"]
    (offset,) = [finding for finding in facts["findings"] if finding["code"] == "force_offset"]
    assert offset["measured"]["value"] == pytest.approx(200.0, abs=1.0)
    assert offset["measured"]["unit"] == "N"


def test_check_names_a_wrong_label_among_several_files(tmp_path: Path, record: Path) -> None:
    head, *rows = record.read_text().splitlines()
    for number, factor in enumerate((1.0, 1.01, 0.99, 1.5)):
        scaled = (row.rsplit(",", 1) for row in rows)
        text = "\n".join(f"{rest},{factor * float(force):.9f}" for rest, force in scaled)
        (tmp_path / f"run{number}_10mm1Hz0x5A.csv").write_text(f"{head}\n{text}\n")
    files = sorted(tmp_path.glob("run*.csv"))
    found = json.loads(mrwork("check", *files, "--json").stdout)["set"]
    assert [finding["code"] for finding in found] == ["command_mislabelled"]
    assert "run3_10mm1Hz0x5A.csv" in found[0]["message"]
    assert "all files together:" in mrwork("check", *files).stdout


def test_repairs_are_made_on_request_and_logged(record: Path, refused: Refused) -> None:
    result = mrwork("check", record, "--repair", "offset=100", "--repair", "velocity")
    assert "repaired: a static force of +100 N was subtracted" in result.stdout
    assert "no velocity to repair" in result.stdout
    refused.command("identify", record, "--repair", "polish", "--model", "static_hysteretic")
    refused.command("check", record, "--repair", "delay=soon")


def test_identify_writes_a_run_that_predict_reads(record: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    arguments = (
        "identify",
        record,
        "--model",
        "static_hysteretic",
        "--seed",
        "1",
        "--out",
        out,
        "--json",
        *FAST,
    )
    summary = json.loads(printed(*arguments))
    expected = (
        "model parameters fit_percent nrmse rmse_n error_norms status stop_reason evaluations seconds n_time"
    )
    assert set(expected.split()) <= set(summary)
    assert set(summary["parameters"]["c"]) >= {"value", "unit", "standard_error", "lower", "upper"}
    assert {path.name for path in out.iterdir()} >= {
        "manifest.json",
        "fit.json",
        "journal.jsonl",
        "report.html",
    }
    assert not (out / "figures").exists()
    assert "http://" not in (out / "report.html").read_text().replace("http://www.w3.org", "")
    predicted = json.loads(mrwork("predict", out, record, "--json").stdout)
    assert predicted["files"][0]["fit_percent"] == pytest.approx(summary["fit_percent"], abs=1e-9)
    assert {"file", "fit_percent", "nrmse", "rmse_n", "n_time"} <= set(predicted["files"][0])


def test_a_prediction_without_the_nuisances_of_its_fit_says_so(
    tmp_path: Path, record: Path, refused: Refused
) -> None:
    out = tmp_path / "run"
    arguments = (
        "identify",
        record,
        "--model",
        "hyperbolic_tangent_guo",
        "--nuisance",
        "offset",
        "--out",
        out,
    )
    text = printed(*arguments, "--json", "--quiet", *FAST)
    as_fitted = json.loads(mrwork("predict", out, record, "--json").stdout)
    assert (as_fitted["nuisances"], as_fitted["warnings"]) == (["offset"], [])
    assert as_fitted["files"][0]["fit_percent"] == pytest.approx(json.loads(text)["fit_percent"], abs=1e-6)
    assert as_fitted["files"][0]["nuisance"]["offset"] != 0.0
    without = mrwork("predict", out, record, "--nuisance", "none", "--json")
    (warning,) = json.loads(without.stdout)["warnings"]
    assert "estimated the offset of the force for each test" in warning
    assert f"warning: {warning}" in mrwork("predict", out, record, "--nuisance", "none").stdout
    refused.command("predict", out, record, "--nuisance", "none", "--nuisance", "level")


def test_several_tests_have_a_median_a_worst_and_each_finding_once(tmp_path: Path, record: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_bytes(record.read_bytes())
    out = tmp_path / "run"
    arguments = (
        "identify",
        record,
        other,
        "--model",
        "static_hysteretic",
        "--repair",
        "offset=100",
        "--out",
        out,
    )
    text = mrwork(*arguments, "--quiet", *FAST).stdout
    assert text.count("a static force of +100 N was subtracted") == 1
    found = json.loads(mrwork(*arguments, "--quiet", "--json", "--replace", *FAST).stdout)
    fits = [each["fit_percent"] for each in found["files"]]
    assert [each["file"] for each in found["files"]] == [each["test"] for each in found["files"]]
    assert (found["median_fit_percent"], found["worst_fit_percent"]) == (sum(fits) / 2, min(fits))
    assert "repaired in all 2 tests:" in text
    assert "2 tests: fit median" in text
    predicted = mrwork("predict", out, record, other, "--json")
    spread = json.loads(predicted.stdout)["spread"]
    percents = [row["fit_percent"] for row in json.loads(predicted.stdout)["files"]]
    assert spread["worst_percent"] == min(percents)
    assert spread["median_percent"] == pytest.approx(sum(percents) / 2)
    assert "2 tests: fit median" in mrwork("predict", out, record, other).stdout


def test_identify_starts_from_an_earlier_run(tmp_path: Path, refused: Refused) -> None:
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
    model = ("--model", "hyperbolic_tangent_guo")
    refused.command("identify", test, *model, "--start", first)
    refused.command("identify", test, "--start", tmp_path / "none")


def test_explicit_columns_and_windows_are_used(tmp_path: Path, record: Path, refused: Refused) -> None:
    other = tmp_path / "rig.csv"
    other.write_text(record.read_text().replace("force_kN", "F", 1))
    refused.command("check", other)
    result = mrwork(
        "check", other, "--column", "force=F:kN", "--from", "0.5", "--every", "2", "--settle", "0", "--json"
    )
    (facts,) = json.loads(result.stdout)["files"]
    assert facts["n_time"] == 150
    assert facts["settle_seconds"] == 0.0


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


def test_ctrl_c_keeps_the_best_so_far(tmp_path: Path) -> None:
    out = tmp_path / "run"
    journal = tmp_path / "run.part" / "journal.jsonl"
    settings = ("--population", "1000", "--every", "4", "--quiet")
    with started(*COMMAND, "identify", "synthetic:spencer1997", "--out", out, *settings) as process:
        # Its header and two generations.
        wait_until(lambda: journal.is_file() and journal.read_bytes().count(b"\n") > 2, process)
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, stderr
    assert "interrupted" in stdout
    fit = json.loads((out / "fit.json").read_text())
    assert fit["status"] == "interrupted"
    printed("predict", out, "synthetic:spencer1997", "--json")


def test_an_interrupt_before_anything_is_found_leaves_the_earlier_run(tmp_path: Path, record: Path) -> None:
    out = tmp_path / "run"
    printed("identify", record, "--model", "static_hysteretic", "--out", out, *FAST)
    before = {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}
    # A first generation of a million candidates takes minutes.
    settings = ("--population", "1000000", "--quiet")
    with started(*COMMAND, "identify", "synthetic:spencer1997", "--out", out, *settings) as process:
        wait_until((tmp_path / "run.part").exists, process)
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, stderr
    assert stdout == ""
    assert {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()} == before


def test_importing_and_asking_for_help_load_nothing_heavy() -> None:
    heavy = "{'jax', 'matplotlib', 'numpy', 'scipy', 'optimistix', 'jinja2', 'numba'}"
    check = f"import sys; print(sorted({heavy} & set(sys.modules)))"
    imported = ran(sys.executable, "-c", f"import mrwork; {check}", check=True)
    assert imported.stdout.strip() == "[]"
    shows_help = f"from mrwork.cli.door import parser\nparser().format_help()\n{check}"
    helped = ran(sys.executable, "-c", shows_help, check=True)
    assert helped.stdout.strip() == "[]"


TOLD = """
import atexit, gc, os, sys
before = gc.get_threshold()
atexit.register(lambda: print(os.environ.get("OPENBLAS_NUM_THREADS"), gc.get_threshold() == before, file=sys.stderr))
from mrwork.cli import main
"""


def told_by(code: str, **environment: str) -> list[str]:
    """Threads of OpenBLAS at the end of a process, and whether garbage is looked for as before."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    inherited = {name: value for name, value in os.environ.items() if name not in names}
    run = ran(sys.executable, "-c", TOLD + code, "--version", env=inherited | environment, check=True)
    return run.stderr.split()


def test_a_command_multiplies_matrices_on_one_thread() -> None:
    assert told_by("main()") == ["1", "False"]


@pytest.mark.parametrize(
    ("name", "threads"), [("OPENBLAS_NUM_THREADS", ["2", "False"]), ("OMP_NUM_THREADS", ["None", "False"])]
)
def test_threads_that_the_user_has_set_stay(name: str, threads: list[str]) -> None:
    assert told_by("main()", **{name: "2"}) == threads


def test_the_process_of_a_calling_program_stays_as_it_is() -> None:
    assert told_by("main(['--version'])") == ["None", "True"]
