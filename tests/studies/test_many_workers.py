"""The study of work on other processes: what it records of chunks, and its simulated schedule."""

from __future__ import annotations

from functools import partial

import pytest

import mrwork as mr
from studies.many_workers.study import LINK, Chunk, efficiency, recorded, sizes, study_of


def chunk(seconds: float, *, shared: int = 0, sent: int = 0) -> Chunk:
    return Chunk(shared=shared, sent=shared + sent, received=0, seconds=seconds)


def test_a_worker_that_does_all_is_busy_all_the_time() -> None:
    assert efficiency([[chunk(1.0), chunk(2.0)], [chunk(3.0)]], 4.0, 1) == 1.0


def test_workers_wait_at_barriers_for_the_client_and_for_its_link() -> None:
    ones = [chunk(1.0), chunk(1.0)]
    assert efficiency([ones], 0.0, 2) == 1.0
    assert efficiency([ones[:1], ones[:1]], 0.0, 2) == 0.5
    assert efficiency([ones], 1.0, 2) == pytest.approx(3.0 / 2.0 / 2.0)
    second = [chunk(1.0, shared=int(LINK)), chunk(1.0)]
    # The two carry what they share, a second each; from the second call on perhaps not.
    assert efficiency([second], 0.0, 2) == pytest.approx(2.0 / 3.0 / 2.0)
    assert efficiency([second, second], 0.0, 2, kept=True) == pytest.approx(4.0 / 4.0 / 2.0)


def test_chunks_of_a_study_are_recorded_by_their_calls() -> None:
    study = study_of(motions=1, draws=2, budget=24)
    calls, alone = recorded(partial(mr.run_study, study, threads=1))
    assert alone > 0.0
    for call in calls:
        assert call[0].shared > 1000
        assert not any(each.shared for each in call[1:])
        assert all(0.0 < each.seconds < 60.0 for each in call)
    assert sizes(calls)["chunks"] == max(map(len, calls))
