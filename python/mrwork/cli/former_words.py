"""Command lines of earlier releases in the words of today; each is told, and taken for one release more."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from mrwork.cli.terminal import note

_DEMO = ("identify", "synthetic:spencer1997", "--model", "normalised_bouc_wen")
# The first word of a command line, and the words in its place.
_VERBS: dict[str, tuple[str, ...]] = {
    "demo": _DEMO,
    "profile": ("intervals",),
    "sample": ("intervals", "--posterior"),
    "convert": ("models",),
    "cite": ("report", "--cite"),
    "completion": ("--completion",),
}
# Options of `respond` that replaced its simulation, and the verb that has them, or does without them, in its place.
_TOPICS = {"--schema": "study", "--laws": "laws"}
_LISTINGS = {"--building": "check", "--pushover": "check", "--size": "tune"}


def in_words_of_today(words: Sequence[str]) -> list[str]:
    """A command line as it is typed today; what stands for another is told on stderr."""
    verb, *rest = words or [""]
    now: list[str] | None = None
    if verb in _VERBS and not {"-h", "--help"} & {*rest}:
        given = ["--seed", "1"] * (verb == "demo" and "--seed" not in rest)
        given += ["--out", "out/demo"] * (verb == "demo" and "--out" not in rest)
        now = [*_VERBS[verb], *given, *rest]
    elif verb == "respond" and (topic := next((word for word in rest if word in _TOPICS), "")):
        now = ["help", _TOPICS[topic]]
    elif verb == "respond" and (listing := next((word for word in rest if word in _LISTINGS), "")):
        now = [_LISTINGS[listing], *(word for word in rest if word != "--building")]
    if now is None:
        return list(words)
    was, is_now = (shlex.join(["mrwork", *line]) for line in (words, now))
    note(f"`{was}` is `{is_now}` now; the earlier words are taken for one release more")
    return now
