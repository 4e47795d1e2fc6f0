"""Families of models to be compared, each with the laws and bounds that apply to its parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from mrwork.dampers.parameters import LawName
from mrwork.dampers.spec import DamperSpec, damper, damper_models
from mrwork.errors import SettingError, UnknownNameError
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.level_search import spec_by_values, tested_commands
from mrwork.records import DamperTest
from mrwork.units import CommandUnit

ALL = "all"


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """A model with its laws, and the bounds of its parameters."""

    spec: DamperSpec
    bounds: dict[str, tuple[float, float]]


def families(
    models: str | Sequence[DamperSpec | str],
    tests: tuple[DamperTest, ...],
    *,
    laws: Mapping[str, LawName],
    unit: CommandUnit,
    lagged: bool = False,
    bounds: Mapping[str, tuple[float, float]],
) -> tuple[tuple[Family, ...], tuple[str, ...]]:
    """The named families, or all, and remarks on the selection."""
    specs, remarks = compared_models(models)
    lawful = [_with_own_laws(spec, tests, laws, unit, lagged) for spec in specs]
    refuse_unknown("law", laws, {each.name for spec in specs for each in spec.plain})
    refuse_unknown("bound", bounds, {name for spec in lawful for name in spec.names})
    plain = [spec.name for spec in lawful if spec.current is None]
    if laws and plain:
        remarks += (f"none of the parameters that follow the command is one of {', '.join(plain)}",)
    return (
        tuple(
            Family(spec=spec, bounds={name: pair for name, pair in bounds.items() if name in spec.names})
            for spec in lawful
        ),
        remarks,
    )


def compared_models(
    models: DamperSpec | str | Sequence[DamperSpec | str],
) -> tuple[tuple[DamperSpec, ...], tuple[str, ...]]:
    """The named models, or all, and remarks on the selection.

    "all" leaves out models that are identified in the parameters of another one, because they have the same fit.
    """
    if isinstance(models, str) and models == ALL:
        others = {spec.name: identifiable_form(spec, {}).spec.name for spec in damper_models()}
        return (
            tuple(spec for spec in damper_models() if others[spec.name] == spec.name),
            tuple(
                f"{name} is not listed: it is {form} in other parameters"
                for name, form in others.items()
                if name != form
            ),
        )
    named = [models] if isinstance(models, str | DamperSpec) else models
    specs = tuple(damper(each) if isinstance(each, str) else each for each in named)
    names = [spec.name for spec in specs]
    if not names or len(set(names)) < len(names):
        raise SettingError(f"the models to compare are {', '.join(names) or 'none'}; name each once")
    return specs, ()


def refuse_unknown(what: str, names: Iterable[str], known: Collection[str]) -> None:
    """Refuse a law or bound, in words `what`, of a parameter that is none of those `known`."""
    for name in names:
        if name not in known:
            raise UnknownNameError(
                f"a {what} was given for {name!r}, which none of the models has as a parameter"
            )


def _with_own_laws(
    spec: DamperSpec,
    tests: tuple[DamperTest, ...],
    laws: Mapping[str, LawName],
    unit: CommandUnit,
    lagged: bool,
) -> DamperSpec:
    own = {name: law for name, law in laws.items() if name in {each.name for each in spec.plain}}
    if not own:
        return spec
    lawful = spec.with_current_laws(own, unit=unit, lagged=lagged)
    return spec_by_values(lawful, tested_commands(lawful, tests))
