"""Another identification does not go on with a journal, and one that a callback stops goes on to the same fit.

That each does from any line of its journal, and after a kill, is tested in `tests/faults`.
"""

import shutil
from contextlib import closing
from pathlib import Path

import pytest
from command_line import printed
from refusals import command_refusal

import mrwork as mr

SHORT = ["--population", "16", "--generations", "12"]
COMMAND = ["identify", "synthetic:spencer1997", "--every", "16", "--seed", "3", *SHORT]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of a genetic search, then local minimisations one by one."""
    folder = tmp_path_factory.mktemp("genetic") / "run"
    printed(*COMMAND, "--out", folder)
    return folder


def part_with(tmp_path: Path, content: bytes) -> Path:
    """A place whose unfinished run has this journal."""
    place = tmp_path / "run"
    place.mkdir()
    (place / "journal.jsonl").write_bytes(content)
    return place


def refused(place: Path, arguments: list[object], word: str) -> None:
    """Exit 2, the word, and nothing has changed."""
    before = {path: path.read_bytes() for path in place.parent.rglob("*") if path.is_file()}
    command_refusal(*arguments, "--out", place, "--resume", match=word)
    assert {path: path.read_bytes() for path in place.parent.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--seed", "4"], "another identification.* seed is 3 there and 4 here"),
        (["--fix", "n=2"], "bounds.n is absent there"),
        (["--every", "4"], "test.1.samples"),
        (["--model", "static_hysteretic"], "model is normalised_bouc_wen there"),
    ],
)
def test_a_run_of_something_else_is_refused_by_name(
    whole: Path, tmp_path: Path, arguments: list[str], word: str
) -> None:
    refused(part_with(tmp_path, (whole / "journal.jsonl").read_bytes()), [*COMMAND, *arguments], word)


def test_a_resumption_over_a_finished_run_of_another_seed_changes_nothing(
    whole: Path, tmp_path: Path
) -> None:
    shutil.copytree(whole, tmp_path / "run")
    refused(tmp_path / "run", [*COMMAND, "--seed", "4"], "seed is 3 there and 4 here")


# From Python


@pytest.fixture(scope="module")
def record() -> mr.DamperTest:
    return mr.records.cut(mr.synthetic_test("spencer1997"), every=4)


SEARCH = mr.search.EfficientGA(population=16, stop=mr.search.StopRules(max_generations=12))


@pytest.fixture(scope="module")
def static(record: mr.DamperTest) -> mr.Fit:
    return mr.identify("static_hysteretic", record, search=SEARCH, rng=2)


@pytest.mark.parametrize(("stage", "least"), [("search", 3), ("screening", 3), ("refinement", 1)])
def test_a_callback_may_stop_the_run_and_it_goes_on(
    record: mr.DamperTest, static: mr.Fit, tmp_path: Path, stage: str, least: int
) -> None:
    path = tmp_path / "journal.jsonl"
    seen: list[mr.Progress] = []

    def enough(progress: mr.Progress) -> bool:
        seen.append(progress)
        return (
            progress.stage == stage
            and progress.numbers.get("iterations", progress.numbers["evaluations"]) >= least
        )

    settings = {"search": SEARCH, "rng": 2}
    with closing(mr.Journal(path)) as journal:
        stopped = mr.identify("static_hysteretic", record, **settings, on_progress=enough, journal=journal)
    assert stopped.status == "stopped"
    assert stopped.stop_reason == ("callback" if stage == "search" else "max_generations")
    assert all(estimate.standard_error is None for estimate in stopped.estimates)
    assert seen[-1].stage == stage
    with closing(mr.Journal(path, resume=True)) as journal:
        resumed = mr.identify("static_hysteretic", record, **settings, journal=journal)
    for name in ("theta", "evaluations", "status", "trace"):
        assert getattr(resumed, name) == getattr(static, name)


def test_a_fit_by_optimistix_is_recalled(record: mr.DamperTest, tmp_path: Path) -> None:
    stages: list[str] = []
    settings = {"search": SEARCH, "engine": "optimistix", "rng": 2}

    def identified(*, resume: bool) -> mr.Fit:
        with closing(mr.Journal(tmp_path / "journal.jsonl", resume=resume)) as journal:
            return mr.identify(
                *("static_hysteretic", record),
                **settings,
                on_progress=lambda progress: stages.append(progress.stage),
                journal=journal,
            )

    first = identified(resume=False)
    assert "refinement" in stages
    stages.clear()
    again = identified(resume=True)
    assert stages == []
    assert (again.theta, again.refinement_steps) == (first.theta, first.refinement_steps)
