"""The fixture `refused`: another sentence fails."""

import pytest
from sentences import TESTS, Refused

from mrwork.errors import InvalidSettingError


def test_another_sentence_another_key_and_no_refusal_fail() -> None:
    def refuse(sentence: str, key: str = "size") -> None:
        if sentence:
            raise InvalidSettingError(key, sentence)

    expected = ["InvalidSettingError of `size`: give one"]
    Refused(expected, TESTS)(refuse, "give one")
    for given in (("give two",), ("give one", "width"), ("",)):
        with pytest.raises((AssertionError, pytest.fail.Exception)):
            Refused(expected, TESTS)(refuse, *given)
