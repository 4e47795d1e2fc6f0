"""Pages of the Python interface: a page for each public name, a list for each namespace.

A name is public where `__all__` of its namespace has it, which follows from the stub.
A value that several namespaces list has one page, that of the first.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from enum import Enum
from functools import cache
from types import ModuleType

import mrwork as mr
from generate.markdown import code, document, fenced, prose, table, toctree


class Kind(Enum):
    """Kinds of public names by the headings of their sections."""

    FUNCTION = "Functions"
    CLASS = "Classes"
    CONSTANT = "Constants"


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicName:
    """A name of a namespace, and the full name by which it is described, that of the first namespace that lists it."""

    name: str
    value: object
    full: str

    @property
    def kind(self) -> Kind:
        """What it is."""
        if inspect.isclass(self.value):
            return Kind.CLASS
        return Kind.FUNCTION if inspect.isroutine(self.value) else Kind.CONSTANT

    @property
    def page(self) -> str:
        """Its page below the list of the namespaces; `Building` and `building` differ where files do not."""
        return f"{self.kind.value.lower()}/{self.full}"

    def is_described_in(self, path: str) -> bool:
        """Whether its page is that of the namespace."""
        return self.full == f"{path}.{self.name}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Namespace:
    """A namespace with its public names, sorted."""

    path: str
    module: ModuleType
    names: tuple[PublicName, ...]


@cache
def namespaces() -> tuple[Namespace, ...]:
    """The package and its namespaces, outer ones first."""
    described: dict[int, str] = {}
    return tuple(_namespace(path, module, described) for path, module in _modules("mrwork", mr))


def _modules(path: str, module: ModuleType) -> Iterator[tuple[str, ModuleType]]:
    yield path, module
    for name in module.__all__:
        inner = getattr(module, name)
        if isinstance(inner, ModuleType):
            yield from _modules(f"{path}.{name}", inner)


def _namespace(path: str, module: ModuleType, described: dict[int, str]) -> Namespace:
    values = [(name, getattr(module, name)) for name in module.__all__ if not name.startswith("__")]
    names = [
        PublicName(name=name, value=value, full=described.setdefault(id(value), f"{path}.{name}"))
        for name, value in values
        if not isinstance(value, ModuleType)
    ]
    return Namespace(path=path, module=module, names=tuple(sorted(names, key=lambda each: each.name.lower())))


def described_names() -> dict[str, str]:
    """The full name under which a name is described, for each way to write it in a docstring."""
    found = {}
    for namespace in namespaces():
        for each in namespace.names:
            path = f"{namespace.path}.{each.name}"
            if each.kind is not Kind.FUNCTION or "_" in each.name:
                # A single word may be that of a parameter instead.
                found[each.name] = each.full
            found |= dict.fromkeys(
                (path, path.removeprefix("mrwork."), f"mr.{path.removeprefix('mrwork.')}"), each.full
            )
    return found


def plain_types(signature: str) -> str:
    """A signature without what `Annotated` adds to a type, and without the shape and type of an array."""
    for begin, keep in _NOTED:
        while found := begin.search(signature):
            end, first = _bracket_ends(signature, found.end())
            kept = signature[found.end() : first] if keep is None else keep
            signature = f"{signature[: found.start()]}{kept}{signature[end:]}"
    return signature


_NOTED = (
    (re.compile(r"~?(?:typing\.)?Annotated\["), None),
    (re.compile(r"~?(?:numpy\.)?ndarray\["), "~numpy.ndarray"),
)


def _bracket_ends(text: str, start: int) -> tuple[int, int]:
    """Position after the bracket that was opened before `start`, and the end of the first entry in it."""
    depth, first = 1, 0
    for position in range(start, len(text)):
        depth += {"[": 1, "(": 1, "]": -1, ")": -1}.get(text[position], 0)
        if not first and (depth == 0 or (depth == 1 and text[position] == ",")):
            first = position
        if depth == 0:
            return position + 1, first
    return len(text), first or len(text)


def api_pages() -> dict[str, str]:
    """Page of each public name and of each namespace, and the list of namespaces."""
    pages = {"index": _index()}
    for namespace in namespaces():
        pages[namespace.path] = _list(namespace)
        for each in namespace.names:
            if each.is_described_in(namespace.path):
                pages[each.page] = _page(each)
    return pages


def _index() -> str:
    rows = [(f"[`{each.path}`]({each.path}.md)", prose(_first_line(each.module))) for each in namespaces()]
    return document(
        "(python-interface)=\n# Python interface",
        "`import mrwork as mr` loads a namespace when it is first used. Arguments of what is listed here are checked; "
        "all numbers are in SI units. Every name has types for a type checker.",
        table(("namespace", "what it holds"), rows),
        toctree(*(each.path for each in namespaces()), hidden=""),
    )


def _list(namespace: Namespace) -> str:
    sections = [_section(kind, [each for each in namespace.names if each.kind is kind]) for kind in Kind]
    own = [each.page for each in namespace.names if each.is_described_in(namespace.path)]
    return document(
        f"# `{namespace.path}`",
        prose(_first_line(namespace.module)),
        *sections,
        toctree(*own, hidden="") if own else "",
    )


def _section(kind: Kind, names: list[PublicName]) -> str:
    rows = [(f"[`{each.name}`]({each.page}.md)", prose(_first_line(each.value))) for each in names]
    return document(f"## {kind.value}", table(("name", "what it is"), rows)).rstrip() if rows else ""


def _first_line(value: object) -> str:
    """The first line of a docstring; that of a constant's type says nothing of the constant."""
    if not (inspect.isroutine(value) or inspect.isclass(value) or inspect.ismodule(value)):
        return ""
    return (inspect.getdoc(value) or "").partition("\n\n")[0]


def _page(public: PublicName) -> str:
    if public.kind is Kind.FUNCTION:
        described = f".. autofunction:: {public.full}"
    elif public.kind is Kind.CONSTANT:
        described = f".. autodata:: {public.full}\n   :no-value:"
    else:
        is_error = inspect.isclass(public.value) and issubclass(public.value, BaseException)
        members = _members(public.value) if inspect.isclass(public.value) else ""
        described = (
            f".. {'autoexception' if is_error else 'autoclass'}:: {public.full}\n   :members:{members}"
        )
    return document(f"# {code(public.name)}", fenced("{eval-rst}", described))


def _members(kind: type) -> str:
    """Members by name where a part of the class is a data class without a page of its own; all own ones otherwise."""
    parts = [
        base for base in kind.__mro__[1:] if is_dataclass(base) and base.__name__ not in described_names()
    ]
    names = [
        name
        for part in (kind, *parts)
        for name, member in vars(part).items()
        if name[0] != "_" and (inspect.isroutine(member) or isinstance(member, property))
    ]
    return f" {', '.join(dict.fromkeys(names))}" if parts else ""
