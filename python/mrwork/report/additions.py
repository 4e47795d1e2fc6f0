"""What later verbs add to a run directory: documents and figures, each written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.errors import OutputError
from mrwork.report.fit_json import json_document
from mrwork.report.run_directory import FIGURES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add_to_run(place: Path, name: str, document: object, figures: Mapping[str, Figure]) -> None:
    """Write a JSON document, and figures as `figures/<name>.svg` and `.png`, in place of earlier ones.

    Raises
    ------
    OutputError
        Where they cannot be written.
    """
    # Slow to load, and of no use to whoever only reads.
    from mrwork.report.svg import png_bytes, svg_bytes

    contents = {name: json_document(document).encode()}
    for figure_name, figure in figures.items():
        contents[f"{FIGURES}/{figure_name}.svg"] = svg_bytes(figure)
        contents[f"{FIGURES}/{figure_name}.png"] = png_bytes(figure)
    try:
        for relative, content in contents.items():
            target = place / relative
            target.parent.mkdir(exist_ok=True)
            descriptor, beside = tempfile.mkstemp(prefix=f".{target.name}-", dir=target.parent)
            try:
                with os.fdopen(descriptor, "wb") as stream:
                    stream.write(content)
                Path(beside).replace(target)
            finally:
                Path(beside).unlink(missing_ok=True)
    except OSError as reason:
        raise OutputError(
            f"cannot write {relative} to {place}: {reason.strerror or reason}; make room or give leave to write there"
        ) from reason
