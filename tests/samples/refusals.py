"""Refusals that tests provoke: an error of ours in one printable line, told by a word and not by its whole sentence."""

import re
from collections.abc import Callable
from typing import Any

import pytest
from command_line import mrwork

from mrwork.errors import MistakesError, MrworkError


def refusal(call: Callable[..., object], *args: Any, match: str, **kwargs: Any) -> MrworkError:
    """The error in which a call ends, whose text contains the regular expression `match`.

    Arguments are of any type, as they are to be wrong. Of several mistakes in a file each has a line.
    """
    with pytest.raises(MrworkError) as raised:
        call(*args, **kwargs)
    error = raised.value
    lines = error.mistakes if isinstance(error, MistakesError) else (error,)
    assert all(str(line).isprintable() for line in lines), f"not one printable line: {error!r}"
    assert re.search(match, str(error)), f"`{match}` is not in: {error}"
    return error


def command_refusal(*arguments: object, match: str) -> str:
    """What stderr says of a command line that ends with status 2 and nothing on stdout."""
    ended = mrwork(*arguments)
    assert (ended.returncode, ended.stdout) == (2, ""), ended.stderr
    assert re.search(match, ended.stderr), f"`{match}` is not in: {ended.stderr}"
    return ended.stderr
