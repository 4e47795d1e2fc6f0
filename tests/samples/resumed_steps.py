"""A choice that Ctrl-C ends, and that goes on in the same run folder."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from mrwork.errors import Interrupted
from mrwork.store.output_folder import Destination
from mrwork.store.run_folder import FIT_RUN
from mrwork.store.unfinished import StepJournals
from mrwork.uncertainty.choice.choose import ChoiceProgress


def stopped_and_resumed(
    folder: Path,
    choose: Callable[..., Any],
    stop: Callable[[ChoiceProgress], bool],
    told: list[ChoiceProgress] | None = None,
) -> tuple[Any, Any]:
    """What a choice has when `stop` holds, and what it comes to when it is resumed."""
    place = Destination(path=folder / "run", kind=FIT_RUN)

    def interrupt(progress: ChoiceProgress) -> None:
        if stop(progress):
            raise KeyboardInterrupt

    with (
        pytest.raises(Interrupted) as interrupted,
        closing(StepJournals(place, resume=False)) as journals,
    ):
        choose(journal_of=journals, on_progress=interrupt)
    with closing(StepJournals(place, resume=True)) as journals:
        seen = told if told is not None else []
        return interrupted.value.result, choose(journal_of=journals, on_progress=seen.append)
