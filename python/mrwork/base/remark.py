"""What a result says to its user. A kind is declared once, beside what finds it: code, words, cure and verbs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import ClassVar, Final, Literal, get_args

from mrwork.base.numbers import in_plain, value_and_error

Severity = Literal["note", "warning", "repaired"]
Verb = Literal["check", "identify", "predict", "calibrate", "intervals", "plan", "report"]
EVERY_VERB: Final[tuple[Verb, ...]] = get_args(Verb)
OF_FILES: Final[tuple[Verb, ...]] = ("check", "identify", "predict", "calibrate")
"""Verbs that take files; the others take the tests of a run, whose remarks its identification has said."""
ONCE: Final[tuple[Verb, ...]] = ("check", "identify")
"""Verbs that say remarks which change no number by themselves."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A measured number, in `unit`; `standard_error` is `None` if it cannot be estimated."""

    _made_by: ClassVar[str] = "remark.measured"

    value: float
    unit: str
    standard_error: float | None = None

    def in_words(self, factor: float = 1.0) -> str:
        """The number times a factor, with its standard error if that is known."""
        if self.standard_error is None:
            return f"{factor * self.value:.3g}"
        texts = value_and_error(factor * self.value, abs(factor) * self.standard_error)
        return " +- ".join(map(in_plain, texts))


@dataclass(frozen=True, slots=True)
class RemarkKind:
    """A kind of remark: `code` for programs, `text` for people, and the verbs that say it.

    A remark with a `cure` is a warning, and one that `repaired` a record its log; others are notes, unless the kind
    `warns` of what nothing cures. Text and cure are templates: numbered fields are words, which tell remarks apart,
    named fields are numbers, and `value` is the measured number. A repair of the kind `cured_by` removes the remark.
    """

    code: str
    text: str
    cure: str = ""
    verbs: tuple[Verb, ...] = field(default=EVERY_VERB, kw_only=True)
    cured_by: str | None = field(default=None, kw_only=True)
    repaired: bool = field(default=False, kw_only=True)
    warns: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        REMARK_KINDS[self.code] = self

    @property
    def severity(self) -> Severity:
        """Whether a remark asks for action, or is the log of one."""
        if self.repaired:
            return "repaired"
        return "warning" if self.cure or self.warns else "note"

    def remark(self, *words: str, measured: Measured | None = None, **numbers: float | str) -> Remark:
        """A remark of this kind; a number whose digits depend on its error is given as text."""
        template = f"{self.text}; {self.cure}" if self.cure else self.text
        value = 0.0 if measured is None else measured.value
        return Remark(
            code=self.code,
            severity=self.severity,
            message=template.format(*words, value=value, **numbers),
            measured=measured,
            words=words,
        )


REMARK_KINDS: Final[dict[str, RemarkKind]] = {}
"""The kinds by code, of the modules that are loaded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """What a result says to its user: code of its kind, severity, the `message` for people, the measured size, if any.

    Remarks of one kind with the same `words` differ in their numbers alone.
    """

    _made_by: ClassVar[str] = "fit.remarks"

    code: str
    severity: Severity
    message: str
    measured: Measured | None = None
    words: tuple[str, ...] = ()

    @property
    def as_sentence(self) -> str:
        """The message as a sentence with its stop."""
        return f"{self.message[:1].upper()}{self.message[1:]}."

    @property
    def in_words(self) -> str:
        """Severity and message, as a line of the terminal."""
        return f"{self.severity}: {self.message}"


def warnings_of(remarks: Iterable[Remark]) -> tuple[str, ...]:
    """The messages of those remarks that are warnings."""
    return tuple(remark.message for remark in remarks if remark.severity == "warning")
