"""Labels of the constant commands of a study: passive-off, passive-on and optimal passive.

Folders, journals and study files of earlier versions have other labels for them; they are read here, and nowhere else.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

PASSIVE_OFF = "Passive-off"
PASSIVE_ON = "Passive-on"
OPTIMAL_PASSIVE = "Optimal passive"

_FORMER: Mapping[str, str] = {
    "i = 0": PASSIVE_OFF,
    "Largest command": PASSIVE_ON,
    "Best constant command": OPTIMAL_PASSIVE,
}
# The label of the optimal passive ends with its command, as in "Best constant command, 1.32 A".
_COMMAND = r"(?=$|, [^,]+ [AV]$)"
# Warnings end the label of a row with a full stop or a semicolon.
_IN_WARNING = re.compile(rf"(?<= with )({'|'.join(_FORMER)})(?=[;,.])")


def present_label(label: str) -> str:
    """The label that this version gives a row which an earlier one has labelled."""
    return _replace(label, _FORMER)


def present_sentence(sentence: str) -> str:
    """A stored warning on a row, with the label that this version gives it."""
    return _IN_WARNING.sub(lambda match: _FORMER[match.group()], sentence)


def recorded_label(label: str) -> str:
    """The label by which journals know a row: that of the first version, so that all can be resumed."""
    return _replace(label, {present: former for former, present in _FORMER.items()})


def _replace(label: str, names: Mapping[str, str]) -> str:
    pattern = rf"^({'|'.join(map(re.escape, names))}){_COMMAND}"
    return re.sub(pattern, lambda match: names[match.group()], label)
