"""Sphinx extension: signatures with plain types, and references to public names however a docstring writes them."""

from __future__ import annotations

from inspect import isfunction
from typing import Any

from docutils import nodes
from numpy.typing import ArrayLike
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.pycode import ModuleAnalyzer
from sphinx.util import logging
from sphinx.util.typing import stringify_annotation

from generate.api_pages import described_names, plain_types
from generate.pages import GENERATED

_LOG = logging.getLogger(__name__)
_NAMES = described_names()
# What autodoc writes for the union that this name stands for.
_ARRAY_LIKE = stringify_annotation(ArrayLike, "smart")


def setup(app: Sphinx) -> dict[str, Any]:
    """Listen to what autodoc has found, and to references that lead nowhere."""
    app.connect("autodoc-process-signature", _without_notes)
    app.connect("missing-reference", _by_any_path)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _without_notes(
    app: Sphinx,
    what: str,
    name: str,
    value: object,
    options: object,
    signature: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    if isfunction(value):
        # An overloaded function is described by its whole signature.
        analyzer = ModuleAnalyzer.for_module(value.__module__)
        analyzer.analyze()
        analyzer.overloads.pop(value.__qualname__, None)
    return _plain(signature), _plain(returned)


def _plain(signature: str | None) -> str | None:
    return signature and plain_types(signature.replace(_ARRAY_LIKE, "~numpy.typing.ArrayLike"))


def _by_any_path(
    app: Sphinx, environment: BuildEnvironment, node: pending_xref, shown: nodes.Element
) -> nodes.Element | None:
    """A name such as `mr.dampers.damper`, which is described as `mrwork.damper`."""
    if node.get("refdomain") != "py":
        return None
    name = node["reftarget"]
    full = _NAMES.get(name)
    if full is None:
        # Docstrings put parameters and types of other libraries between the same signs; a page means a name.
        if GENERATED not in node["refdoc"]:
            _LOG.warning("there is no public name %s", name, location=node, type="ref", subtype="name")
        return None
    domain = environment.domains.python_domain
    return domain.resolve_xref(environment, node["refdoc"], app.builder, "obj", full, node, shown)
