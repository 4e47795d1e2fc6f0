"""A choice that Ctrl-C ends, and that goes on in the same run folder."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from mrwork import Progress
from mrwork.errors import Interrupted
from mrwork.store.journal import Journal
from mrwork.store.run_folder import FIT_RUN, MODELS
from mrwork.store.run_writer import RunAtWork


def step_journal(work: RunAtWork, step: str) -> Journal:
    return work.journal(f"{MODELS}/{step}.jsonl")


def stopped_and_resumed(
    folder: Path,
    choose: Callable[..., Any],
    stop: Callable[[Progress], bool],
    told: list[Progress] | None = None,
) -> tuple[Any, Any]:
    """What a choice has when `stop` holds, and what it comes to when it is resumed."""
    first, again = (RunAtWork(folder / "run", FIT_RUN, resume=resume) for resume in (False, True))

    def interrupt(progress: Progress) -> None:
        if stop(progress):
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as interrupted, first as work:
        choose(journal_of=partial(step_journal, work), on_progress=interrupt)
    with again as work:
        seen = told if told is not None else []
        return interrupted.value.result, choose(
            journal_of=partial(step_journal, work), on_progress=seen.append
        )
