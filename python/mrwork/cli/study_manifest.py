"""What a run folder states of a command on a study file: command, seed, versions, and the digest of the file."""

from __future__ import annotations

import argparse
import platform
import shlex
import sys
from datetime import UTC, datetime
from typing import Any

from mrwork import __version__
from mrwork.store import digest_of
from mrwork.store.input_file import TOML, text_of


def command_line() -> str:
    """The command as it was given."""
    return shlex.join(["mrwork", *sys.argv[1:]])


def study_manifest(
    options: argparse.Namespace, *, kind: str, title: str, status: str, seconds: float
) -> dict[str, Any]:
    """The manifest of a run on the file `options.study` with the seed `options.seed`."""
    return {
        "kind": kind,
        "title": title,
        "status": status,
        "command": command_line(),
        "seed": options.seed,
        "study": {
            "path": str(options.study),
            "content": digest_of(text_of(options.study, TOML)),
        },
        "versions": {"mrwork": __version__, "python": platform.python_version()},
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "seconds": seconds,
    }
