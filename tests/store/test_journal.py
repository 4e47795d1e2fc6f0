"""A journal gives back what was written, to the bit, and refuses what it cannot vouch for."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from refusals import refusal

from mrwork import Journal
from mrwork.errors import JournalError
from mrwork.store.codec import digest_of

pytestmark = pytest.mark.contract
FACTS = {"seed": 1, "bounds": {"n": [1.0, 2.0]}, "files": [{"sha256": "ab"}]}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """A result as those of descents are."""

    theta: NDArray[np.float64]
    arrived: NDArray[np.bool_]
    misfit: float
    steps: int

    @property
    def bits(self) -> tuple[object, ...]:
        arrays = [(each.dtype, each.shape, each.tobytes()) for each in (self.theta, self.arrived)]
        return *arrays, repr(self.misfit), self.steps


RESULTS = [
    Found(theta=theta, arrived=theta > 0.2, misfit=misfit, steps=steps)
    for theta, misfit, steps in (
        (np.array([0.1, -5e-324, 1.7976931348623157e308]), 1.0 / 3.0, 3),
        (np.array([[math.inf, -0.0, math.nan]]), math.inf, 0),
        (np.pi * np.arange(3.0), 0.0, 10**18),
    )
]


class Count:
    """A counter, of which each step takes five."""

    def __init__(self) -> None:
        self.number = 0

    def as_record(self) -> dict[str, int]:
        return {"number": self.number}

    def restore(self, record: Mapping[str, Any]) -> None:
        self.number = record["number"]


def run(journal: Journal, facts: dict[str, Any] = FACTS) -> tuple[list[object], list[int], list[int]]:
    """Three steps: their results, the counts after each, and the numbers of those that were computed."""
    count, computed = Count(), list[int]()

    def compute(step: int) -> Found:
        computed.append(step)
        count.number += 5
        return RESULTS[step]

    try:
        journal.carry(count)
        journal.agree("run", facts)
        results, counts = list[object](), list[int]()
        for step in range(3):
            recalled = journal.once("descent", digest_of(step), Found, lambda step=step: compute(step))  # type: ignore[misc] # its own step
            results.append(recalled.bits)
            counts.append(count.number)
        return results, counts, computed
    finally:
        journal.close()


WHOLE = [each.bits for each in RESULTS]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A journal of the whole run."""
    path = tmp_path_factory.mktemp("whole") / "journal.jsonl"
    run(Journal(path))
    return path.read_bytes()


@pytest.fixture
def path(tmp_path: Path, whole: bytes) -> Path:
    (tmp_path / "journal.jsonl").write_bytes(whole)
    return tmp_path / "journal.jsonl"


def test_every_number_and_count_comes_back_and_nothing_is_computed_twice(path: Path) -> None:
    assert run(Journal(path, resume=True)) == (WHOLE, [5, 10, 15], [])


def test_every_line_is_json_and_says_what_it_is(path: Path) -> None:
    def refused(constant: str) -> None:
        pytest.fail(f"{constant} is not JSON")

    lines = [json.loads(line, parse_constant=refused) for line in path.read_text().splitlines()]
    assert [line["step"] for line in lines] == ["run", "descent", "descent", "descent"]
    assert [line["line"] for line in lines] == [1, 2, 3, 4]
    assert lines[0]["facts"] == FACTS


def test_a_journal_cut_anywhere_goes_on_to_the_same_results_without_its_torn_line(
    path: Path, whole: bytes
) -> None:
    ends = [position + 1 for position, byte in enumerate(whole) if byte == ord("\n")]
    for length in sorted({*range(0, len(whole), 40), *(end + d for end in ends for d in (-2, -1, 0))}):
        path.write_bytes(whole[:length])
        notes: list[str] = []
        results, counts, computed = run(Journal(path, resume=True, note=notes.append))
        n_whole = sum(end <= length for end in ends)
        assert (results, counts) == (WHOLE, [5, 10, 15])
        # The first line is not a step.
        assert computed == list(range(max(n_whole - 1, 0), 3))
        torn = length - max([0, *(end for end in ends if end <= length)])
        assert [f"last {torn} bytes" in note for note in notes] == ([True] if torn else [])
        lines = path.read_bytes().splitlines(keepends=True)
        assert b"".join(lines[:n_whole]) == whole[: ends[n_whole - 1] if n_whole else 0]
        assert len(lines) == 4
        # The time goes on where it stood.
        times = [json.loads(line)["seconds"] for line in lines]
        assert times == sorted(times)


@examples(100)
@given(data=st.data())
def test_a_damaged_journal_is_refused_and_kept_or_gives_the_same_results(
    data: st.DataObject, whole: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "journal.jsonl"
    place, lost = data.draw(st.integers(0, len(whole) - 1)), data.draw(st.sampled_from([0, 1, 1, 60, 400]))
    damaged = whole[:place] + data.draw(st.binary(max_size=2)) + whole[place + lost :]
    path.write_bytes(damaged)
    try:
        assert run(Journal(path, resume=True, note=lambda _: None))[0] == WHOLE
    except JournalError:
        assert path.read_bytes() == damaged


def refuses(path: Path, content: bytes, match: str) -> None:
    path.write_bytes(content)
    refusal(lambda: run(Journal(path, resume=True)), match=match)
    assert path.read_bytes() == content


def test_damage_before_a_sound_line_and_a_missing_line_are_refused_by_number(path: Path) -> None:
    whole = path.read_bytes()
    lines, second = whole.splitlines(keepends=True), whole.index(b"\n") + 1
    flipped = whole[:second] + bytes([whole[second] ^ 1]) + whole[second + 1 :]
    refuses(path, flipped, "damaged in line 2, with sound lines after it")
    refuses(path, b"".join([lines[0], *lines[2:]]), "descent where this run comes to another descent")
    refuses(path, 2 * b'{"generation": 1, "best": 0.5}\n', "not a journal that this version can resume")
    # The last line is dropped instead.
    path.write_bytes(whole[:-30] + b"x" + whole[-29:])
    notes: list[str] = []
    assert run(Journal(path, resume=True, note=notes.append))[2] == [2]
    assert len(notes) == 1


def test_a_run_that_rests_on_something_else_is_refused_by_name(path: Path) -> None:
    before = path.read_bytes()
    for other, differs in (
        ({"seed": 2}, "seed is 1 there and 2 here"),
        ({"bounds": {"n": [1.0, 3.0]}}, "bounds.n.2 is 2.0 there and 3.0 here"),
        ({"bounds": {}}, "absent here"),
    ):
        refusal(run, Journal(path, resume=True), facts=FACTS | other, match=differs)
        assert path.read_bytes() == before


def test_a_program_that_goes_another_way_is_told(path: Path) -> None:
    journal = Journal(path, resume=True)
    journal.agree("run", FACTS)
    refusal(journal.recall, "generation", digest_of(0), dict, match="descent where .* another generation")


def test_a_fresh_journal_takes_the_place_of_an_earlier_one_when_it_writes(path: Path) -> None:
    before = path.read_bytes()
    journal = Journal(path, replace=True)
    assert path.read_bytes() == before
    journal.agree("run", {"seed": 7})
    journal.close()
    assert len(path.read_text().splitlines()) == 1


def test_one_journal_at_a_time_writes_until_it_is_closed(path: Path) -> None:
    first = Journal(path, resume=True)
    refusal(Journal, path, resume=True, match="close that journal first")
    refusal(Journal(path, replace=True).agree, "run", FACTS, match="close that journal first")
    first.close()
    before = path.read_bytes()
    refusal(first.record, "descent", "", {}, match="was closed before")
    assert path.read_bytes() == before
    Journal(path, resume=True).close()
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_a_digest_tells_every_bit_apart() -> None:
    array, next_one = np.arange(6.0), np.nextafter(1.0, 2.0)
    others = [np.nextafter(array, 9.0), array.reshape(2, 3), array.astype(np.int64)]
    inputs = [(array,), *((other,) for other in others), (array, 1.0), (array, next_one), (array, "1.0"), ()]
    assert len({digest_of(*each) for each in inputs}) == len(inputs)
    assert digest_of(array[::2]) == digest_of(array[::2].copy())
