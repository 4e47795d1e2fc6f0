"""The parser of a verb: options in groups by purpose, help with examples, and one sentence for a wrong command line."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import takewhile
from typing import Any, NoReturn

from mrwork.errors import escape_text

RECORDS = "records"
MEASUREMENT = "measurement"
SEARCH = "search"
COMPUTATION = "computation"
OUTPUT = "output"
"""Titles of the groups of options that several verbs have."""

_EXAMPLES = "examples:"
_INDENT = "  "


def examples(*lines: str) -> str:
    """The end of a verb's help; the lines run as they are typed in a folder where the lines of the tour have run."""
    return "\n".join([_EXAMPLES, *(f"{_INDENT}{line}" for line in lines)])


def examples_in(epilog: str | None) -> tuple[str, ...]:
    """The lines that `examples` was given."""
    heading, *lines = (epilog or "").splitlines() or [""]
    return tuple(line.removeprefix(_INDENT) for line in lines) if heading == _EXAMPLES else ()


class VerbHelp(argparse.HelpFormatter):
    """Wraps a description, but no example, and leaves the options to their groups instead of the usage as well."""

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[Any],
        prefix: str | None = None,
    ) -> None:
        """Write the usage with the required arguments only; [options] stands for all others."""
        needed = [action for action in actions if action.required or not action.option_strings]
        words = f"{self._format_usage(usage, needed, [], '').strip()} [options]".replace("%", "%%")
        margin = " " * len("usage: ")
        lines = textwrap.wrap(
            words, self._width - len(margin), break_long_words=False, break_on_hyphens=False
        )
        super().add_usage(f"\n{margin}".join(lines), [], [], prefix)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if examples_in(text):
            return textwrap.indent(text, indent)
        return super()._fill_text(text, width, indent)


class CommandParser(argparse.ArgumentParser):
    """Reports a wrong command line in one line, without the usage; of a misspelt word it names the nearest."""

    def error(self, message: str) -> NoReturn:
        """Exit with status 2 and the message in one line, which ends with the way to the help."""
        self.exit(2, f"{self.prog}: {escape_text(message)}; see {self.prog} --help\n")

    def parse_known_args(  # type: ignore[override] # of the overloads this package uses one
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse a command line, of which no word may be left."""
        words = list(sys.argv[1:] if args is None else args)
        self._refuse_unknown_option(words)
        options, left = super().parse_known_args(words, namespace)
        if left and left[0].startswith("-"):
            self.error(f"no option is called {left[0]!r}")
        if left:
            several = any(
                action.nargs in ("+", "*") and not action.option_strings for action in self._actions
            )
            together = "; give all files together, with no option between" if several else ""
            self.error(f"there is no place for {left[0]!r}{together}")
        return options, left

    def _refuse_unknown_option(self, words: Sequence[str]) -> None:
        # Options after a verb belong to the verb's parser.
        options = (
            takewhile(_is_option, words) if self._subparsers else takewhile(lambda word: word != "--", words)
        )
        names = list(self._option_string_actions)
        for word in options:
            name = word.partition("=")[0]
            # argparse takes the beginning of an option for the option, and a text with a blank for an argument.
            if _is_option(word) and " " not in word and not any(entry.startswith(name) for entry in names):
                # Loads difflib, which only a mistake needs.
                from mrwork.base.keys import closest

                near = closest(name[2:], [entry[2:] for entry in names if entry.startswith("--")])
                of_verb = "; options of a verb come after it" if self._subparsers else ""
                self.error(f"no option is called {name!r}{f', did you mean --{near}' if near else of_verb}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        from mrwork.base.keys import suggestion

        near = suggestion(value, [*action.choices])
        if isinstance(action, argparse._SubParsersAction):
            self.error(f"no verb is called {value!r}{near}")
        self.error(f"{'/'.join(action.option_strings) or action.metavar or action.dest} is {value!r}{near}")

    def option(
        self,
        title: str,
        name: str,
        help: str,
        reads: Callable[[str], Any] | type | None = None,
        *,
        metavar: str | None = None,
        default: Any = None,
        dest: str | None = None,
        choices: Collection[str] | None = None,
        repeated: bool = False,
        required: bool = False,
    ) -> None:
        """Declare an option in the group of this title; `reads` makes its value of a text, and `bool` takes none.

        A `name` may have several spellings, with spaces between.

        The help ends with the default, if it is a number or a word, and with the range of a number. What is `repeated`
        is added to the default, or is one entry where that is `None`.
        """
        group = self.group(title)
        if reads is bool:
            group.add_argument(name, help=help.replace("%", "%%"), dest=dest, action="store_true")
            return
        stated = "" if "default" in help else _stated(default)
        repeat = "repeat for more" if repeated and default is not None else ""
        parts = [help, repeat, stated, getattr(reads, "in_words", "")]
        group.add_argument(
            *name.split(),
            help="; ".join(filter(None, parts)).replace("%", "%%"),
            type=reads or str,
            metavar=metavar,
            default=default,
            dest=dest,
            choices=choices,
            required=required,
            action=Collect if repeated else "store",
        )

    def describe(self, more: str) -> None:
        """Add to the description, which begins with the line of the verb in the help of all."""
        self.description = f"{self.description} {more}"

    def group(self, title: str) -> argparse._ArgumentGroup:
        """The group of options with this title, which is made when it is first asked for."""
        made = next((group for group in self._action_groups if group.title == title), None)
        return made or self.add_argument_group(title)


def given_options(options: argparse.Namespace) -> dict[str, str]:
    """The options of a verb that are not as their defaults, each as it is typed, by its destination."""
    actions = [action for action in options.parser._actions if action.option_strings]
    return {
        action.dest: action.option_strings[0]
        for action in actions
        if getattr(options, action.dest, action.default) != action.default
    }


def _is_option(word: str) -> bool:
    return word.startswith("--") and word != "--"


def _stated(default: Any) -> str:
    if isinstance(default, float):
        return f"default {default:g}"
    return f"default {default}" if isinstance(default, str | int) else ""


class Collect(argparse.Action):
    """Values of a repeated option, in place of its default; a name only once."""

    # argparse calls it with these arguments.
    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        value: Any,
        option_string: str | None = None,
    ) -> None:
        """Add the values of one occurrence; a name that is given twice is refused."""
        # What argparse gives where there is none of any number.
        if value is self.default:
            return
        before = getattr(namespace, self.dest)
        collected: Any = () if before is self.default else before
        for item in value if isinstance(value, list) else [value]:
            if not isinstance(item, tuple):
                collected = (*collected, item)
                continue
            name, entry = item
            if name in collected:
                parser.error(f"{option_string or 'the command line'} gives {name} twice; give it once")
            collected = dict(collected) | {name: entry}
        setattr(namespace, self.dest, collected)
