"""Study files with several mistakes: whether one refusal names each in its line, and none that is no mistake.

A mistake is one line of a whole study written wrongly. What it is refused with alone must be among what several are
refused with together, and nothing else may be.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Final

from mrwork.errors import MistakesError, MrworkError
from mrwork.store.parse import toml_table
from mrwork.study import read_study

_ROOT: Final = Path(__file__).parents[2] / "studies"
_STUDIES: Final = ("chapter_2/[mrsv]*_*.toml", "respond/quick_start.toml")
_PAIR: Final = re.compile(r"(\s*)([\w.]+)(\s*=\s*)(.*?)(\s*(?:#.*)?)")
_HEADER: Final = re.compile(r"\[\[?([\w.]+)\]\]?(.*)")
# Of other kinds than the value, of other units, and out of any range.
_VALUES: Final = (
    *(
        "true",
        "[]",
        "{}",
        '"text"',
        '""',
        "[[1]]",
        "3",
        "-1",
        "-1e9",
        "nan",
        "1e999",
        "1e101",
        "0",
        "1_000_000",
    ),
    *('"1 kg"', '"1 mm"', '"-1 s"', '"12 parsec"', '"1e3kN"', '"5e"', '[1, "x"]', '["x"]', "1979-05-27"),
    "[nan]",
)
_NAMES: Final = ("qzx", "surplus_key", "law", "zeta", "record", "m", "T1", "mr_damper", "Sample-Time", "x y")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """One line of a study written wrongly: its number from 0, the text in its place, and what kind of mistake it is."""

    line: int
    text: str
    kind: str


@dataclass(slots=True, kw_only=True)
class Rates:
    """How many mistakes were made, alone and together, and what became of them."""

    studies: int = 0
    single: int = 0
    several_for_one: int = 0
    together: int = 0
    named: int = 0
    masked: Counter[str] = field(default_factory=Counter)
    false: list[str] = field(default_factory=list)
    tracebacks: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        """The rates on a few lines."""
        masked = ", ".join(f"{kind} {count}" for kind, count in self.masked.most_common())
        return (
            f"{self.single} mistakes alone, {self.several_for_one} of them told as more than one\n"
            f"{self.together} mistakes in {self.studies} studies with several: {self.named} named in their lines "
            f"({100.0 * self.named / max(self.together, 1):.1f} %), {len(self.false)} sentences on what is no mistake\n"
            f"not named: {masked or 'none'}; tracebacks: {len(self.tracebacks)}"
        )


def mistakes_in(text: str, rng: random.Random) -> Iterator[Mistake]:
    """Mistakes of every kind at random lines of a study, without end."""
    lines = text.splitlines()
    places = [number for number, line in enumerate(lines) if _PAIR.fullmatch(line) or _HEADER.fullmatch(line)]
    while True:
        number = rng.choice(places)
        if header := _HEADER.fullmatch(lines[number]):
            wrong = lines[number].replace(header[1], _misspelt(header[1], rng), 1)
            yield Mistake(line=number, text=wrong, kind="name of a table")
            continue
        pair = _PAIR.fullmatch(lines[number])
        assert pair is not None
        indent, name, equals, value, rest = pair.groups()
        match rng.choice(["misspelt", "other", "value", "value", "value", "name", "gone"]):
            case "misspelt":
                yield Mistake(
                    line=number,
                    text=f"{indent}{_misspelt(name, rng)}{equals}{value}{rest}",
                    kind="key misspelt",
                )
            case "other":
                other = rng.choice(_NAMES)
                other = other if re.fullmatch(r"[\w-]+", other, re.ASCII) else f'"{other}"'
                yield Mistake(line=number, text=f"{indent}{other}{equals}{value}{rest}", kind="other key")
            case "value":
                yield Mistake(
                    line=number, text=f"{indent}{name}{equals}{rng.choice(_VALUES)}{rest}", kind="value"
                )
            case "name" if value.startswith('"'):
                wrong = f'"{_misspelt(value[1:-1], rng)}"'
                yield Mistake(line=number, text=f"{indent}{name}{equals}{wrong}{rest}", kind="name misspelt")
            case _:
                yield Mistake(line=number, text="", kind="line left out")


def _misspelt(word: str, rng: random.Random) -> str:
    place = rng.randrange(len(word))
    match rng.choice(["gone", "twice", "other"]):
        case "gone":
            return word[:place] + word[place + 1 :] or "z"
        case "twice":
            return word[:place] + word[place] + word[place:]
    return word[:place] + rng.choice("aeiorstn") + word[place + 1 :]


def sentences_on(text: str, mistakes: Sequence[Mistake], path: Path, rates: Rates) -> list[str] | None:
    """What a study with these mistakes is refused with, a sentence each; `None` where it is no TOML, or fails."""
    lines = text.splitlines()
    for each in mistakes:
        lines[each.line] = each.text
    changed = "\n".join(lines) + "\n"
    try:
        toml_table(changed)
    except ValueError:
        return None
    path.write_text(changed)
    try:
        read_study(path)
    except MistakesError as several:
        return [str(each) for each in several.mistakes]
    except MrworkError as error:
        return [str(error)]
    except Exception as error:
        rates.tracebacks.append(f"{mistakes}: {error!r}")
        return None
    return []


def whole_studies() -> list[str]:
    """Studies that need no other files: the sample, one of many tables, and those of the repository."""
    sample = files("mrwork.cli").joinpath("samples", "study.toml").read_text()
    return [sample, *(path.read_text() for name in _STUDIES for path in sorted(_ROOT.glob(name)))]


def measured(texts: Sequence[str], n_studies: int, folder: Path, *, seed: int = 0, most: int = 6) -> Rates:
    """Read studies with 2 to `most` mistakes, of each text in turn; files that they name lie in the folder."""
    rates, rng = Rates(), random.Random(seed)
    sources: list[tuple[str, Iterator[Mistake]]] = [(text, mistakes_in(text, rng)) for text in texts]
    while rates.studies < n_studies:
        text, source = sources[rates.studies % len(sources)]
        chosen: dict[int, tuple[Mistake, str]] = {}
        for _ in range(rng.randint(2, most)):
            mistake = next(source)
            alone = sentences_on(text, [mistake], folder / "study.toml", rates)
            if not alone or mistake.line in chosen:
                continue
            rates.single += 1
            rates.several_for_one += len(alone) > 1
            if len(alone) == 1:
                chosen[mistake.line] = mistake, alone[0]
        together = sentences_on(text, [each for each, _ in chosen.values()], folder / "study.toml", rates)
        if len(chosen) < 2 or together is None:
            continue
        rates.studies += 1
        rates.together += len(chosen)
        told = Counter(map(_place_of, together))
        for mistake, sentence in chosen.values():
            if told[_place_of(sentence)]:
                told[_place_of(sentence)] -= 1
                rates.named += 1
            else:
                rates.masked[mistake.kind] += 1
        expected = "; ".join(sentence for _, sentence in chosen.values())
        rates.false += [
            f"{each} [of {expected}]"
            for each in together
            if told[_place_of(each)] > 0 and not any(each == sentence for _, sentence in chosen.values())
        ]
    return rates


def _place_of(sentence: str) -> str:
    """File and line of a sentence."""
    return sentence.partition(": ")[0]


def main() -> int:
    """Print the rates; exit status 1 where something is told that is no mistake."""
    parser = argparse.ArgumentParser(prog="mistakes", description=__doc__)
    parser.add_argument(
        "--studies", type=int, default=2000, help="studies with several mistakes (default 2000)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the random mistakes (default 0)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        rates = measured(whole_studies(), options.studies, Path(name), seed=options.seed)
    print(rates)
    print(*dict.fromkeys([*rates.false, *rates.tracebacks]), sep="\n")
    return 1 if rates.false or rates.tracebacks else 0


if __name__ == "__main__":
    sys.exit(main())
