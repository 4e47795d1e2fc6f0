"""What checks find in a record. A kind of finding is declared once, beside its check: code, words, cure and verbs."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Final, Literal, get_args

from mrwork.base.numbers import in_plain, value_and_error

Severity = Literal["note", "warning", "repaired"]
Verb = Literal["check", "identify", "predict", "calibrate", "sample", "profile", "plan", "report"]
EVERY_VERB: Final[tuple[Verb, ...]] = get_args(Verb)
OF_FILES: Final[tuple[Verb, ...]] = ("check", "identify", "predict", "calibrate")
"""Verbs that take files; the others take the tests of a run, whose findings its identification has said."""
ONCE: Final[tuple[Verb, ...]] = ("check", "identify")
"""Verbs that say findings which change no number by themselves."""

RepairKind = Literal["rest", "pulses", "offset", "velocity"]
REPAIR_KINDS: Final[tuple[RepairKind, ...]] = get_args(RepairKind)


@dataclass(frozen=True, slots=True)
class Measured:
    """A number measured by a check, in `unit`; `standard_error` is `None` if it cannot be estimated."""

    _made_by: ClassVar[str] = "finding.measured"

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
class FindingKind:
    """A kind of finding: `code` for programs, `text` for people, and the verbs that say it.

    A finding with a `cure` is a warning, and one that `repaired` the record its log; others are notes. Text and cure
    are templates: numbered fields are words, which tell findings apart, named fields are numbers, and `value` is the
    measured number. A repair of the kind `cured_by` removes the finding.
    """

    code: str
    text: str
    cure: str = ""
    verbs: tuple[Verb, ...] = EVERY_VERB
    cured_by: RepairKind | None = None
    repaired: bool = False

    @property
    def severity(self) -> Severity:
        """Whether the finding asks for action, or is the log of one."""
        return "repaired" if self.repaired else "warning" if self.cure else "note"

    def found(self, *words: str, measured: Measured | None = None, **numbers: float | str) -> Finding:
        """A finding of this kind; a number whose digits depend on its error is given as text."""
        template = f"{self.text}; {self.cure}" if self.cure else self.text
        value = 0.0 if measured is None else measured.value
        message = template.format(*words, value=value, **numbers)
        return Finding(kind=self, message=message, measured=measured, words=words)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Result of a check: its kind, the `message` for people, and the measured size, if any."""

    _made_by: ClassVar[str] = "test.findings"

    kind: FindingKind
    message: str
    measured: Measured | None = None
    words: tuple[str, ...] = ()

    @property
    def code(self) -> str:
        """Name of the kind, for programs."""
        return self.kind.code

    @property
    def severity(self) -> Severity:
        """Whether the finding is a note, a warning or a repair."""
        return self.kind.severity

    def document(self) -> dict[str, Any]:
        """What `mrwork check --json` prints of a finding."""
        measured = None if self.measured is None else asdict(self.measured)
        return {"code": self.code, "severity": self.severity, "message": self.message, "measured": measured}
