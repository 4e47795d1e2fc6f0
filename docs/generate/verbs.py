"""Pages of the verbs, from their argument parsers."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType

from generate.markdown import directive, document, fenced, prose, table, toctree
from mrwork.cli.door import parser, verbs

# Characters of a line of the usage.
_WIDTH = 74
# An option of at least so many verbs is one that they share.
_SHARED = 4
EXIT_STATUS = (
    ("0", "done; a reader of stdout that leaves early, such as `head`, ends nothing"),
    (
        "2",
        "bad input, or no stdout, space or memory; one sentence on stderr says what was expected and what to do",
    ),
    ("130", "interrupted by Ctrl-C; what was found is kept"),
    ("143", "ended by SIGTERM; what was found is kept"),
)


@cache
def _commands() -> Mapping[str, argparse.ArgumentParser]:
    """Parser of each verb."""
    return MappingProxyType({verb: _subparsers(parser([verb]))[verb] for verb in verbs()})


def _subparsers(root: argparse.ArgumentParser) -> Mapping[str, argparse.ArgumentParser]:
    groups = [each for each in root._actions if isinstance(each, argparse._SubParsersAction)]
    return groups[0].choices


def purposes() -> Mapping[str, str]:
    """Each verb with its line in `mrwork --help`."""
    groups = [each for each in parser()._actions if isinstance(each, argparse._SubParsersAction)]
    return {each.dest: each.help or "" for each in groups[0]._choices_actions}


def verb_pages() -> dict[str, str]:
    """Page of each verb, and the list of all."""
    return {"index": _index(), **{verb: _page(verb, command) for verb, command in _commands().items()}}


def _index() -> str:
    rows = [(f"[`mrwork {verb}`]({verb}.md)", prose(purpose)) for verb, purpose in purposes().items()]
    return document(
        "# Command line",
        prose(parser().description or ""),
        table(("verb", "what it does"), rows),
        "## Exit status",
        table(("status", "meaning"), EXIT_STATUS),
        toctree(*verbs(), hidden=""),
    )


def _page(verb: str, command: argparse.ArgumentParser) -> str:
    shared = _shared_options()
    actions = [each for each in command._actions if each.dest != "help"]
    arguments = [each for each in actions if not each.option_strings]
    own = [each for each in actions if each.option_strings and _name(each) not in shared]
    common = [each for each in actions if each.option_strings and _name(each) in shared]
    return document(
        f"({verb}-verb)=\n# `mrwork {verb}`",
        prose(command.description or ""),
        fenced("text", _usage(command)),
        f"```{{program}} mrwork {verb}\n```",
        _section("Arguments", arguments),
        _section(f"Options of `{verb}`", own),
        _section("Options that verbs share", common),
        "## Exit status",
        table(("status", "meaning"), EXIT_STATUS),
    )


def _usage(command: argparse.ArgumentParser) -> str:
    formatter = argparse.HelpFormatter(prog=command.prog, width=_WIDTH)
    formatter.add_usage(None, command._actions, command._mutually_exclusive_groups, prefix="")
    return formatter.format_help()


@cache
def _shared_options() -> frozenset[str]:
    counts = Counter(_name(each) for command in _commands().values() for each in command._actions)
    return frozenset(name for name, count in counts.items() if count >= _SHARED)


def _name(action: argparse.Action) -> str:
    return action.option_strings[-1] if action.option_strings else action.dest


def _section(title: str, actions: Sequence[argparse.Action]) -> str:
    if not actions:
        return ""
    entries = [directive("option", _signature(each), prose(_help(each))) for each in actions]
    return document(f"## {title}", *entries).rstrip()


def _signature(action: argparse.Action) -> str:
    """The words of an option, or the name of an argument."""
    if action.choices is not None:
        value = "{" + ",".join(map(str, action.choices)) + "}"
    else:
        value = str(action.metavar or action.dest.upper())
    if not action.option_strings:
        return str(action.metavar or action.dest)
    takes_value = action.nargs != 0
    return ", ".join(f"{each} {value}" if takes_value else each for each in action.option_strings)


def _help(action: argparse.Action) -> str:
    """The help of an option, with % signs and defaults filled in."""
    return (action.help or "") % {**vars(action), "prog": "mrwork"}
