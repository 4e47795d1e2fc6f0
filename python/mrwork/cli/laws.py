"""Laws by which parameters follow the command, as the command line gives them."""

from __future__ import annotations

import argparse

from mrwork.dampers.parameters import CommandUnit, LawName
from mrwork.errors import SettingError
from mrwork.records import DamperTest


def laws_of(options: argparse.Namespace) -> dict[str, LawName]:
    """Parameter name to law.

    Raises
    ------
    SettingError
        Where one is not of the form NAME=LAW.
    """
    laws: dict[str, LawName] = {}
    for text in options.law:
        name, equals, law = text.partition("=")
        if not (name and equals):
            raise SettingError(f"--law is {text!r}; give NAME=LAW, as in k_w=quadratic")
        laws[name] = law
    return laws


def command_unit(tests: tuple[DamperTest, ...], options: argparse.Namespace) -> CommandUnit:
    """What the laws take: as asked for, or amperes where the tests have a current."""
    in_amperes = any(test.current is not None for test in tests)
    unit: CommandUnit = options.command_unit or ("A" if in_amperes else "V")
    return unit
