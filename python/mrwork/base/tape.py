"""A recorded formula as a list of operations on slots, which the core walks for many runs at once.

Inputs stand in the first slots and constants follow; a slot is taken again as soon as nothing needs its number. A
factor or addend that is a constant stands in a table, without a slot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from mrwork.base.recording import MOST_OPERATIONS, Node, NotRecordedError, Recording

MOST_SLOTS: Final = 2_000
"""Most slots of a tape."""
_WITH_NUMBER: Final = {
    "add": "add_number",
    "multiply": "multiply_number",
    "multiply_add": "multiply_number_add",
}
_LAST = 1 << 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Tape:
    """A formula for the core, which reads the fields by name.

    Attributes
    ----------
    entries
        Name of each operation, slot of its result, and slots of its operands or their places in the table.
    constants
        Constants, each with a slot after those of the inputs.
    table
        Factors and addends without a slot.
    ends
        Slots of the results.
    n_inputs, n_slots
        Numbers of inputs and slots.
    lines
        The line of the user that made each operation.
    """

    entries: tuple[tuple[str, int, tuple[int, ...]], ...]
    constants: tuple[float, ...]
    table: tuple[float, ...]
    ends: tuple[int, ...]
    n_inputs: int
    n_slots: int
    lines: tuple[str, ...] = field(default=(), compare=False, repr=False)


def tape_of(recording: Recording, inputs: Sequence[int], ends: Sequence[int]) -> Tape:
    """The tape of some ends of a recording, whose inputs are these nodes in this order.

    Raises
    ------
    NotRecordedError
        If it is too long.
    """
    nodes = recording.nodes
    order = [at for at in recording.used_by(ends) if at not in set(inputs)]
    numbers = _Numbers(nodes)
    plan = [(at, *_with_number(nodes, at, numbers)) for at in order if nodes[at].op != "const"]
    last = {each: at for at, _, of, _ in plan for each in of}
    last |= dict.fromkeys((*ends, *inputs), _LAST)
    constants = _Numbers(nodes)
    slots = {at: place for place, at in enumerate(inputs)}
    for at in order:
        if nodes[at].op == "const" and at in last:
            slots[at] = len(inputs) + constants.place(at)
    fixed = n_slots = len(inputs) + len(constants.values)
    free: list[int] = []
    entries = []
    for at, op, of, number in plan:
        sources = [slots[each] for each in of]
        free += (slots[each] for each in dict.fromkeys(of) if last[each] == at and slots[each] >= fixed)
        if free:
            slots[at] = free.pop()
        else:
            slots[at], n_slots = n_slots, n_slots + 1
        if number is not None:
            sources.insert(1, number)
        entries.append((op, slots[at], tuple(sources)))
    _refuse_size(nodes, [at for at, *_ in plan], n_slots)
    return Tape(
        entries=tuple(entries),
        constants=tuple(constants.values),
        table=tuple(numbers.values),
        ends=tuple(slots[end] for end in ends),
        n_inputs=len(inputs),
        n_slots=n_slots,
        lines=tuple(nodes[at].line for at, *_ in plan),
    )


class _Numbers:
    """Numbers of constants, each once: by their bits, which tell zero from negative zero."""

    __slots__ = ("_places", "nodes", "values")

    def __init__(self, nodes: Sequence[Node]) -> None:
        self.nodes, self.values = nodes, list[float]()
        self._places: dict[str, int] = {}

    def place(self, at: int) -> int:
        value = self.nodes[at].of[0]
        place = self._places.setdefault(value.hex(), len(self.values))
        if place == len(self.values):
            self.values.append(value)
        return place


def _with_number(
    nodes: Sequence[Node], at: int, numbers: _Numbers
) -> tuple[str, tuple[Any, ...], int | None]:
    """An operation, its operands with slots, and the place of the one in the table, if there is one."""
    op, of = nodes[at].op, nodes[at].of
    if op in _WITH_NUMBER:
        first, second, *rest = of
        fixed = [nodes[each].op == "const" for each in of]
        if fixed[0] != fixed[1] and not any(fixed[2:]):
            kept, number = (second, first) if fixed[0] else (first, second)
            return _WITH_NUMBER[op], (kept, *rest), numbers.place(number)
    return op, of, None


def _refuse_size(nodes: Sequence[Node], operations: Iterable[int], n_slots: int) -> None:
    lines = Counter(nodes[at].line for at in operations)
    if lines.total() > MOST_OPERATIONS:
        (line, most), *_ = lines.most_common(1)
        raise NotRecordedError(
            f"{lines.total():,} operations, of which {most:,} in {line}, where a formula has at most "
            f"{MOST_OPERATIONS:,}; make it shorter",
            "",
        )
    if n_slots > MOST_SLOTS:
        raise NotRecordedError(
            f"{n_slots:,} numbers at once, with its memory and constants, where a formula has at most {MOST_SLOTS:,}; "
            "keep fewer",
            "",
        )
