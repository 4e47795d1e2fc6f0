"""What is finished is kept: chunks beside a journal, journals of fits, a run folder whose workers are lost."""

from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mrwork as mr
from mrwork.errors import WorkerError
from mrwork.store.run_folder import chunks_beside
from mrwork.workers.engine import on_executor
from mrwork.workers.kept_chunks import KeptChunks
from tests.workers.test_engine import CHUNK_STEPS, Counting, loop_of_many_runs


class Failing(Counting):
    """Does some chunks, and is lost then."""

    def __init__(self, chunks: int) -> None:
        super().__init__()
        self.left = chunks

    def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Any:
        self.left -= 1
        if self.left < 0:
            raise RuntimeError("the batch system has ended it")
        return super().submit(function, *args, **kwargs)


def test_chunks_of_a_call_outlive_the_client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mrwork.closed_loop.simulate._CHUNK_STEPS", CHUNK_STEPS)
    run = loop_of_many_runs()
    journal = mr.Journal(tmp_path / "study.jsonl")

    @on_executor
    def study(*, journal: mr.Journal, executor: Executor | mr.Workers) -> Any:
        return run()

    whole, resumed = Counting(), Counting()
    expected = study(journal=journal, executor=whole)
    folder = chunks_beside(journal.path)
    assert expected == run()
    assert not folder.exists()
    with pytest.raises(WorkerError, match="RuntimeError: the batch system has ended it"):
        study(journal=journal, executor=mr.Workers(Failing(5), 1))
    kept = sorted(folder.iterdir())
    assert len(kept) == 5
    # One is damaged, and computed again.
    kept[0].write_bytes(kept[0].read_bytes()[:-40])
    monkeypatch.setattr(mr.Journal, "recalling", True)  # as in a run that is resumed
    assert study(journal=journal, executor=resumed) == expected
    assert len(resumed.sent) == len(whole.sent) - 4
    assert not folder.exists()


def test_files_of_earlier_steps_are_removed_and_damaged_ones_are_none(tmp_path: Path) -> None:
    first, other, later = (
        KeptChunks(folder=tmp_path / "chunks", n_steps=n_steps, fingerprint=name)
        for n_steps, name in ((3, "a"), (3, "b"), (4, "b"))
    )
    arrays = [np.arange(6.0).reshape(2, 3), np.array([3, 4], dtype=np.uint32)]
    first.keep(0, arrays)
    first.keep(2, arrays)
    found = first.recall(3)
    assert [*found] == [0, 2]
    assert all(
        one.dtype == other.dtype and (one == other).all() for one, other in zip(found[2], arrays, strict=True)
    )
    content = bytearray((tmp_path / "chunks" / "000000003-a-0.npz").read_bytes())
    content[len(content) // 3] ^= 1
    (tmp_path / "chunks" / "000000003-a-0.npz").write_bytes(content)
    assert [*first.recall(3)] == [2]
    assert other.recall(3) == {}
    assert len([*(tmp_path / "chunks").iterdir()]) == 2
    assert later.recall(3) == {}
    assert [*(tmp_path / "chunks").iterdir()] == []


@pytest.mark.long
def test_a_choice_goes_on_with_the_lines_of_its_journals(tmp_path: Path) -> None:
    test = mr.synthetic_test("spencer1997")
    settings = {"models": ["dahl", "bingham"]}

    def opened(step: str, *, resume: bool) -> mr.Journal:
        path = tmp_path / f"{step.replace('/', '-')}.jsonl"
        return mr.Journal(path, resume=resume and path.exists())

    expected = mr.choose_model(test, **settings)
    # A lost worker is no failure of a model.
    with pytest.raises(WorkerError, match="a journal keeps what was finished"):
        mr.choose_model(
            test,
            **settings,
            executor=mr.Workers(Failing(1), 1),
            journal_of=lambda step: opened(step, resume=False),
        )
    fits = sorted(tmp_path.glob("*.jsonl"))
    assert fits
    # No worker is needed to go on.
    alone = mr.choose_model(test, **settings, journal_of=lambda step: opened(step, resume=True))
    assert [fit.theta for fit in alone.fits] == [fit.theta for fit in expected.fits]
