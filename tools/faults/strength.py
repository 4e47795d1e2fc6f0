"""How strong the tests are: faults drawn from lines that tests execute, planted, and the first test that fails.

    python -m tools.faults.strength draw LINES SEED > faults.json
    python -m tools.faults.strength plant faults.json LINES CHECKOUT

LINES is the folder of `tools.faults.lines`, CHECKOUT a clone with the compiled module, whose files are changed and
restored. `strength.csv` beside this file has faults of November 2026 (20 in Rust, chosen in the same way) and what
caught them; some tests were written after the draw, which the last column tells.
"""

from __future__ import annotations

import ast
import json
import random
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PACKAGE = Path("python/mrwork")
_OPPOSITE = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}


def faults(tree: ast.Module) -> Iterator[tuple[Any, str, ast.expr]]:
    """Expressions with the kind of a fault and what takes their place."""
    for node in ast.walk(tree):
        match node:
            case ast.BinOp(op=ast.Add() | ast.Sub()) if not _is_text(node.left) and not _is_text(node.right):
                other = ast.Sub() if isinstance(node.op, ast.Add) else ast.Add()
                yield node, "a sign", ast.BinOp(node.left, other, node.right)
                yield node, "a dropped term", node.left
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                yield node, "a factor of two", ast.BinOp(ast.Constant(2), ast.Mult(), node)
            case ast.UnaryOp(op=ast.USub()) if not isinstance(node.operand, ast.Constant):
                yield node, "a sign", node.operand
            case ast.Constant(value=float()) if node.value:
                yield node, "a wrong unit", ast.Constant(1000.0 * float(node.value))  # type: ignore[arg-type]
            case ast.Subscript():
                for index in ast.walk(node.slice):
                    if isinstance(index, ast.Constant) and type(index.value) is int:
                        yield index, "an off-by-one", ast.Constant(index.value + 1)
            case ast.Call(args=[ast.Name() | ast.Attribute(), ast.Name() | ast.Attribute()], keywords=[]):
                yield node, "a swapped pair", ast.Call(node.func, node.args[::-1], [])
            case ast.Call(func=ast.Attribute(attr="copy"), args=[]):
                yield node, "a missing copy", node.func.value
            case ast.Call(func=ast.Attribute(attr="array", value=ast.Name("np")), args=[_]):
                function = ast.parse("np.asarray", mode="eval").body
                yield node, "a missing copy", ast.Call(function, node.args, node.keywords)
            case ast.Compare(ops=[ast.Lt() | ast.LtE() | ast.Gt() | ast.GtE()]):
                swapped = _OPPOSITE[type(node.ops[0])]()
                yield node, "an off-by-one", ast.Compare(node.left, [swapped], node.comparators)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def tests_by_line(folder: Path) -> dict[str, dict[int, list[str]]]:
    """What all processes have written; a line that an import executes has its effect in every test of the file."""
    found: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    for path in folder.glob("*.json"):
        for file, lines in json.loads(path.read_text()).items():
            for number, tests in lines.items():
                found[file][int(number)] |= set(tests)
    of_file = {file: set().union(*lines.values()) for file, lines in found.items()}
    return {
        file: {
            number: sorted((of_file[file] if "import" in tests else tests) - {"import"})
            for number, tests in lines.items()
        }
        for file, lines in found.items()
    }


def draw(folder: Path, seed: int, each: int = 2) -> list[dict[str, Any]]:
    """So many faults of each room, of different kinds."""
    rng, tests = random.Random(seed), tests_by_line(folder)
    rooms = defaultdict[str, Any](lambda: defaultdict(list))
    for path in sorted(PACKAGE.glob("*/**/*.py")):
        file, text = path.relative_to(PACKAGE).as_posix(), path.read_text()
        for node, kind, new in faults(ast.parse(text)):
            if node.lineno != node.end_lineno or not tests.get(file, {}).get(node.lineno):
                continue
            old = text.splitlines()[node.lineno - 1].encode()
            inside = f"({ast.unparse(ast.fix_missing_locations(new))})".encode()
            after = (old[: node.col_offset] + inside + old[node.end_col_offset :]).decode().strip()
            fault = {
                "file": file,
                "line": node.lineno,
                "kind": kind,
                "before": old.decode().strip(),
                "after": after,
            }
            rooms[file.partition("/")[0]][kind].append(fault)
    return [
        rng.choice(kinds[kind])
        for _, kinds in sorted(rooms.items())
        for kind in rng.sample(sorted(kinds), min(each, len(kinds)))
    ]


def plant(fault: dict[str, Any], tests: list[str], checkout: Path) -> str:
    """The first test that fails with the fault, or nothing."""
    path = checkout / PACKAGE / fault["file"]
    text = path.read_text()
    lines = text.split("\n")
    near = [number for number, line in enumerate(lines) if line.strip() == fault["before"]]
    number = min(near, key=lambda each: abs(each - fault["line"] + 1))
    lines[number] = lines[number].replace(fault["before"], fault["after"])
    try:
        path.write_text("\n".join(lines))
        command = [sys.executable, "-m", "pytest", "-x", "-q", "--tb=line", "-rfE", *tests]
        done = subprocess.run(command, cwd=checkout, capture_output=True, text=True)
    finally:
        path.write_text(text)
    failed = re.search(r"^(?:FAILED|ERROR).*?(tests/\S+)", done.stdout, re.MULTILINE)
    return failed[1] if failed else ""


if __name__ == "__main__":
    verb, first, second, *more = sys.argv[1:]
    if verb == "draw":
        print(json.dumps(draw(Path(first), int(second)), indent=1))
    else:
        executed = tests_by_line(Path(second))
        for planted in json.loads(Path(first).read_text()):
            caught = plant(planted, executed[planted["file"]][planted["line"]], Path(more[0]))
            facts = (planted[name] for name in ("file", "line", "kind"))
            print(*facts, caught or "not caught", sep=", ", flush=True)
