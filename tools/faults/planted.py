"""Sweeps of planted faults: `python -m tools.faults.planted LIST [NUMBER] [SEED]`, LIST motions, rigs or studies.

As many inputs with one fault each, in turn of every kind of `FAULTS` of the module `planted_LIST`, as `honest` ones are
written and read, and nothing else. Printed are the share of each kind that is told, and what is said of honest inputs.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.errors import MrworkError

Rng = np.random.Generator
Said = Callable[[Rng, Path], str]
"""What is said of an input that is made at random and written into a folder: empty where nothing is."""


def said_by(read: Callable[..., Any], *arguments: object) -> str:
    """The refusal or the warnings of a reader, with the remarks of what it returns."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = (remark.message for remark in read(*arguments).remarks)
            return " ".join((*found, *(str(each.message) for each in caught)))
        except MrworkError as error:
            return str(error)


def sweep(
    faults: Mapping[str, Sequence[Said]], honest: Said, number: int, seed: int = 71
) -> tuple[dict[str, float], list[str]]:
    """Share of each kind that is told, and what is said of honest inputs, of `number` of either sort."""
    rng, kinds, alarms = np.random.default_rng(seed), [*faults], list[str]()
    told: dict[str, list[bool]] = {kind: [] for kind in kinds[:number]}
    with tempfile.TemporaryDirectory() as folder:
        for index in range(number):
            turn, kind = divmod(index, len(kinds))
            each = faults[kinds[kind]]
            told[kinds[kind]].append(bool(each[turn % len(each)](rng, Path(folder))))
            alarms += filter(None, [honest(rng, Path(folder))])
    return {kind: float(np.mean(each)) for kind, each in told.items()}, alarms


def main(listed: str, number: str = "500", seed: str = "71") -> int:
    """Print the shares; fail where less than 90 % of a kind are told, or over 1 % of honest inputs are asked about."""
    module = import_module(f"tools.faults.planted_{listed}")
    told, alarms = sweep(module.FAULTS, module.honest, int(number), int(seed))
    for kind, share in told.items():
        print(f"{kind:36} {100.0 * share:5.1f} % told")
    print(f"{len(alarms)} of {number} honest inputs are asked about", *alarms[:20], sep="\n")
    return int(min(told.values()) < 0.9 or len(alarms) > 0.01 * int(number))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
