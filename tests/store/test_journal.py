"""A journal gives back what was written, to the bit, and refuses what it cannot vouch for."""

from __future__ import annotations

import json
import math
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sentences import Refused

from mrwork import Journal
from mrwork.errors import JournalError
from mrwork.store.codec import digest_of
from mrwork.store.journal import line_of

FACTS = {"seed": 1, "bounds": {"n": [1.0, 2.0]}, "files": [{"sha256": "ab"}]}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """A result as those of descents are."""

    theta: NDArray[np.float64]
    table: NDArray[np.float64]
    arrived: NDArray[np.bool_]
    misfit: float
    steps: int
    converged: bool


RESULTS = [
    Found(
        theta=theta,
        table=np.outer(theta, [1.0, 0.1]),
        arrived=theta > 0.2,
        misfit=misfit,
        steps=steps,
        converged=on,
    )
    for theta, misfit, steps, on in (
        (np.array([0.1, -5e-324, 1.7976931348623157e308]), 1.0 / 3.0, 3, True),
        (np.array([math.inf, -0.0, math.nan]), math.inf, 0, False),
        (np.pi * np.arange(3.0), 0.0, 10**18, True),
    )
]


def bits(found: Found) -> tuple[object, ...]:
    arrays = [
        (array.dtype, array.shape, array.tobytes()) for array in (found.theta, found.table, found.arrived)
    ]
    return *arrays, repr(found.misfit), found.steps, found.converged


def run(journal: Journal, done: list[int] | None = None, facts: dict[str, Any] = FACTS) -> list[Found]:
    """Three steps; the numbers of those that were computed go to `done`."""

    def compute(step: int) -> Found:
        if done is not None:
            done.append(step)
        return RESULTS[step]

    journal.agree("run", facts)
    found = [journal.once("descent", digest_of(step), Found, lambda: compute(step)) for step in range(3)]  # noqa: B023 - called within the loop
    journal.close()
    return found


def refuses(path: Path, sentence: str, facts: dict[str, Any] = FACTS) -> None:
    before = path.read_bytes()
    with pytest.raises(JournalError, match=sentence):
        run(Journal(path, resume=True), facts=facts)
    assert path.read_bytes() == before


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A journal of the whole run."""
    run(Journal(tmp_path / "journal.jsonl"))
    return tmp_path / "journal.jsonl"


def test_every_number_comes_back_to_the_bit_and_nothing_is_computed_twice(path: Path) -> None:
    done: list[int] = []
    again = run(Journal(path, resume=True), done)
    assert [bits(found) for found in again] == [bits(found) for found in RESULTS]
    assert done == []


def test_every_line_is_json_and_says_what_it_is(path: Path) -> None:
    def refused(constant: str) -> None:
        pytest.fail(f"{constant} is not JSON")

    lines = [json.loads(line, parse_constant=refused) for line in path.read_text().splitlines()]
    assert [line["step"] for line in lines] == ["run", "descent", "descent", "descent"]
    assert [line["line"] for line in lines] == [1, 2, 3, 4]
    assert lines[0]["facts"] == FACTS


def test_a_journal_cut_anywhere_goes_on_to_the_same_journal(path: Path) -> None:
    whole = path.read_bytes()
    ends = [position + 1 for position, byte in enumerate(whole) if byte == ord("\n")]
    for length in range(len(whole) + 1):
        path.write_bytes(whole[:length])
        notes: list[str] = []
        done: list[int] = []
        run(Journal(path, resume=True, note=notes.append), done)
        n_whole = sum(end <= length for end in ends)
        # The first line is not a step.
        assert done == list(range(max(n_whole - 1, 0), 3))
        torn = length - max([0, *(end for end in ends if end <= length)])
        assert [f"last {torn} bytes" in note for note in notes] == ([True] if torn else [])
        steps = [json.loads(line) for line in path.read_text().splitlines()]
        assert [step.get("result") for step in steps] == [
            json.loads(line).get("result") for line in whole.splitlines()
        ]


def test_damage_before_a_sound_line_is_refused_by_its_number(path: Path) -> None:
    whole = path.read_bytes()
    second = whole.index(b"\n") + 1
    for position in (second, second + 60, whole.index(b"\n", second)):
        path.write_bytes(whole[:position] + bytes([whole[position] ^ 1]) + whole[position + 1 :])
        refuses(path, "damaged in line 2, with sound lines after it")


def test_a_line_that_is_missing_is_noticed(path: Path) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([lines[0], *lines[2:]]))
    refuses(path, "lacks a line before its line 2")


def test_a_damaged_last_line_is_dropped_with_a_note(path: Path) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[:-30] + b"x" + whole[-29:])
    notes: list[str] = []
    done: list[int] = []
    run(Journal(path, resume=True, note=notes.append), done)
    assert done == [2]
    assert len(notes) == 1


def test_other_files_are_no_journals(path: Path, refused: Refused) -> None:
    path.write_text('{"generation": 1, "best": 0.5}\n{"generation": 2, "best": 0.4}\n')
    refuses(path, "not a journal that this version can resume")
    refused(Journal, path.with_name("none.jsonl"), resume=True)


def test_a_run_that_rests_on_something_else_is_refused_by_name(path: Path, refused: Refused) -> None:
    before = path.read_bytes()
    others = ({"seed": 2}, {"bounds": {"n": [1.0, 3.0]}}, {"files": [{"sha256": "cd"}]}, {"bounds": {}})
    for number, other in enumerate(others):
        # The run that fails keeps its journal.
        copy = path.with_name(f"{number}.jsonl")
        copy.write_bytes(before)
        refused(run, Journal(copy, resume=True), facts=FACTS | other)
        assert copy.read_bytes() == before


def test_a_program_that_goes_another_way_is_told(path: Path, refused: Refused) -> None:
    journal = Journal(path, resume=True)
    journal.agree("run", FACTS)
    refused(journal.recall, "generation", digest_of(0), dict)


def test_lines_with_a_right_checksum_and_a_wrong_content_are_refused(path: Path) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    entry = json.loads(lines[1])
    del entry["crc32"]
    wrong_results: list[object] = [None, [], {}, {"theta": 1}, entry["result"] | {"steps": "3"}]
    for number, result in enumerate(wrong_results):
        # The run that fails keeps its journal.
        forged = path.with_name(f"{number}.jsonl")
        forged.write_bytes(b"".join([lines[0], line_of(entry | {"result": result}), *lines[2:]]))
        refuses(forged, "line 2 of .* does not hold the result of a descent")
    for change in ({"seconds": None}, {"seconds": "1"}, {"step": 1}, {"facts": 10**400}):
        path.write_bytes(b"".join([lines[0], line_of(entry | change), *lines[2:]]))
        refuses(path, "damaged in line 2")
    deep = line_of({"line": 2, "step": "descent", "seconds": 1.0, "facts": "here"})
    body = deep.rpartition(b', "crc32"')[0].replace(b'"here"', b"[" * 5000 + b"]" * 5000)
    path.write_bytes(lines[0] + body + f', "crc32": "{zlib.crc32(body):08x}"}}\n'.encode() + lines[2])
    refuses(path, "damaged in line 2")


def test_a_fresh_journal_takes_the_place_of_an_earlier_one_when_it_writes(path: Path) -> None:
    before = path.read_bytes()
    journal = Journal(path, replace=True)
    assert path.read_bytes() == before
    journal.agree("run", {"seed": 7})
    journal.close()
    assert len(path.read_text().splitlines()) == 1


def test_one_process_at_a_time_writes(path: Path, refused: Refused) -> None:
    first = Journal(path, resume=True)
    refused(Journal, path, resume=True)
    refused(Journal(path, replace=True).agree, "run", FACTS)
    first.close()
    Journal(path, resume=True).close()


def test_a_journal_that_was_locked_stays_so_until_it_is_closed(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "journal.jsonl"
    first = Journal(path)
    first.lock()
    first.agree("run", FACTS)
    first.finish()
    refused(Journal, path, resume=True)
    first.close()
    Journal(path, resume=True).close()
    assert [entry.name for entry in tmp_path.iterdir()] == ["journal.jsonl"]


def test_a_closed_journal_takes_no_more(path: Path, refused: Refused) -> None:
    journal = Journal(path, resume=True)
    journal.close()
    before = path.read_bytes()
    refused(journal.record, "descent", "", {})
    assert path.read_bytes() == before


def test_a_journal_that_cannot_be_written_says_so(tmp_path: Path, refused: Refused) -> None:
    refused(Journal(tmp_path / "none" / "journal.jsonl").agree, "run", FACTS)


def test_counts_come_back_with_the_steps(tmp_path: Path) -> None:
    class Count:
        def __init__(self) -> None:
            self.number = 0

        def as_record(self) -> dict[str, int]:
            return {"number": self.number}

        def restore(self, record: dict[str, int]) -> None:
            self.number = record["number"]

    counted = []
    for resume in (False, True):
        count = Count()
        journal = Journal(tmp_path / "journal.jsonl", resume=resume)
        journal.carry(count)

        def compute(count: Count = count) -> Found:
            count.number += 5
            return RESULTS[0]

        numbers = []
        for step in range(3):
            journal.once("descent", digest_of(step), Found, compute)
            numbers.append(count.number)
        counted.append(numbers)
        journal.close()
    assert counted == [[5, 10, 15], [5, 10, 15]]


def test_time_goes_on_where_it_stood(path: Path) -> None:
    before = Journal(path, resume=True)
    seconds = before.seconds_before
    before.close()
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:3]))
    run(Journal(path, resume=True))
    times = [json.loads(line)["seconds"] for line in path.read_text().splitlines()]
    assert times == sorted(times)
    assert seconds > 0.0


def test_a_digest_tells_every_bit_apart() -> None:
    array = np.arange(6.0)
    different = [
        digest_of(array),
        digest_of(np.nextafter(array, 9.0)),
        digest_of(array.reshape(2, 3)),
        digest_of(array.astype(np.int64)),
        digest_of(array, 1.0),
        digest_of(array, np.nextafter(1.0, 2.0)),
        digest_of(array, "1.0"),
        digest_of(),
    ]
    assert len(set(different)) == len(different)
    assert digest_of(array[::2]) == digest_of(array[::2].copy())
