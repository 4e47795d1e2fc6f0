"""The golden file of sentences: every entry is of a test that exists."""

from __future__ import annotations

import pytest
from sentences import TESTS, Refused, golden, is_there

from mrwork.errors import InvalidSettingError


def test_every_entry_is_of_a_test_that_provokes_it() -> None:
    entries = [(module, name) for module, tests in golden().items() for name in tests]
    assert entries
    assert [entry for entry in entries if not is_there(*entry)] == []


def test_another_sentence_another_key_and_no_refusal_fail() -> None:
    def refuse(sentence: str, key: str = "size") -> None:
        if sentence:
            raise InvalidSettingError(key, sentence)

    expected = ["InvalidSettingError of `size`: give one"]
    Refused(expected, TESTS)(refuse, "give one")
    for given in (("give two",), ("give one", "width"), ("",)):
        with pytest.raises((AssertionError, pytest.fail.Exception)):
            Refused(expected, TESTS)(refuse, *given)
    with pytest.raises(AssertionError):
        Refused([], TESTS)(refuse, "give one")
