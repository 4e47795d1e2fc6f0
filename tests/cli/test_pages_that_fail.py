"""A page that fails costs no result: verbs write their results first, and what follows is a warning."""

import json
from pathlib import Path

import jinja2
import pytest
from command_line import mrwork, printed
from matplotlib.figure import Figure
from study_texts import ONE_STOREY

import mrwork as mr
from mrwork.store.run_writer import is_complete

pytestmark = pytest.mark.usefixtures("pages")

STUDY = f"""{ONE_STOREY}[[tune]]
laws = ["lyapunov"]
budget = 6
population = 6
[report]
limit = {{ peak_drift_ratio = "0.2 %" }}
"""
RECORD = """[[motion]]
synthetic = "kanai_tajimi"
name = "record {seed}"
seed = {seed}
duration = 3
pga = ["0.05 g", "0.1 g", "0.3 g"]
use = "{use}"
"""
SIZES = ("--model", "bingham", "--every", "20", "--population", "8", "--generations", "2")


def fail(*_: object, **__: object) -> None:
    raise ValueError("could not convert string to float: '17\u202f500'")


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """No page and no figure can be drawn."""
    monkeypatch.setattr(jinja2.Environment, "from_string", fail)
    monkeypatch.setattr(Figure, "savefig", fail)
    return monkeypatch


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    uses = ("test", "test", "training")
    path.write_text(STUDY + "".join(RECORD.format(seed=seed, use=use) for seed, use in enumerate(uses)))
    return path


def undrawn(*arguments: object) -> str:
    """What a verb prints whose page fails: it ends as one whose page was drawn, and warns."""
    ended = mrwork(*arguments)
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    (warning,) = (line for line in ended.stderr.splitlines() if "was not drawn" in line)
    assert "ValueError: could not convert string to float" in warning
    return ended.stdout if "the results are written" not in warning else f"{ended.stdout}{warning}"


@pytest.mark.parametrize(("verb", "kind"), [("respond", mr.StudyResults), ("tune", mr.tuning.TunedStudy)])
def test_a_study_whose_page_fails_is_complete(
    study: Path, failing: pytest.MonkeyPatch, verb: str, kind: type
) -> None:
    out = study.parent / "out"
    said = undrawn(verb, study, "--out", out, "--quiet")
    assert f"mrwork report {out} draws it" in said
    assert "Report: " not in said
    assert is_complete(out)
    assert isinstance(mr.load(out), kind)
    assert json.loads((out / "results.json").read_text())
    failing.undo()
    printed("report", out)
    assert "<svg" in (out / "report.html").read_text()


def test_a_fit_whose_page_fails_is_complete_and_takes_what_later_verbs_add(
    tmp_path: Path, failing: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    fit = undrawn("identify", "synthetic:spencer1997", *SIZES, "--out", out, "--quiet", "--json")
    assert json.loads(fit.splitlines()[0])["model"] == "bingham"
    assert mr.load(out).fit.model == "bingham"
    assert is_complete(out)
    document = json.loads(undrawn("predict", out, "synthetic:spencer1997_slow", "--json").splitlines()[0])
    assert document["stored"] == str(out / "held_out.json")
    assert "files" in document
    undrawn("intervals", out, "--quiet")
    assert (out / "profiles.json").is_file()
