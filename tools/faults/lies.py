"""Sweep of honest and lying records over all models: `python -m tools.faults.lies [honest|lies] [MODEL ...]`.

Printed are the warnings that honest records get, and the share of each lie that is told.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from itertools import product

from mrwork.errors import MrworkError
from tools.faults.lying_records import LIES, MODELS, RIGS, TELLING, TO_AND_FRO, honest, honest_records

# A model of friction and hysteresis each, for lies that all models tell alike.
_SOME: tuple[str, ...] = ("bingham", "bouc_wen")


def sweep_honest(models: Sequence[str]) -> int:
    """Print the warnings of honest records that only a lie should have; return their number."""
    n_records, wrong = 0, Counter[str]()
    for name, columns in honest_records(tuple(models)):
        n_records += 1
        try:
            findings = columns.test().findings
        except MrworkError as error:
            print(f"{name}: refused: {error}")
            continue
        for finding in findings:
            if finding.code in TELLING:
                wrong[finding.code] += 1
                print(f"{name}: {finding.message}")
    print(f"{n_records} honest records, {wrong.total()} warnings of a lie: {dict(wrong)}")
    return wrong.total()


def sweep_lies(models: Sequence[str]) -> None:
    """Print the share of each lie that is told, and where it is told least."""
    for lie in LIES:
        for size in lie.sizes:
            silent = Counter[str]()
            cases = list(product(models, TO_AND_FRO, RIGS))
            told = 0
            for model, motion, rig in cases:
                if lie.is_told(lie.tell(honest(model, motion, rig), size)):
                    told += 1
                else:
                    silent.update((motion.__name__.strip("_"), rig.name))
            where = ", ".join(f"{name} {count}" for name, count in silent.most_common(5))
            print(
                f"{lie.name:44} {size:8g} {100.0 * told / len(cases):5.0f} % of {len(cases)}  {where}",
                flush=True,
            )


def main(arguments: Sequence[str]) -> int:
    """Sweep what is asked for."""
    kind, models = (arguments[0], arguments[1:]) if arguments else ("both", ())
    wrong = sweep_honest(models or MODELS) if kind in ("both", "honest") else 0
    if kind in ("both", "lies"):
        sweep_lies(models or _SOME)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
