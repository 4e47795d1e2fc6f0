"""Damaged copies of a file, each made from the name of its seed and a number, so that it can be made again."""

from __future__ import annotations

import io
import json
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from typing import Any, Final, Literal

from tools.faults.damage import places

Structure = Literal["text", "json", "toml", "journal", "binary", "matlab", "zip"]
"""What a damaged copy is aware of: lines and numbers, keys, checksums, fields of sizes, compressed blocks."""

_NUMBERS: Final = (
    *("nan", "NaN", "inf", "-inf", "Infinity", "1e999", "-1e999", "1e308", "-1e308", "5e-324", "-0", "-0.0"),
    *("0", "1", "-1", "2", "1e3", "1e-9", "0.5", "255", "256", "65536", "2147483647", "2147483648"),
    *("4294967296", "9007199254740993", "9223372036854775807", "9223372036854775808", "18446744073709551616"),
    *(
        "9" * 400,
        "-" + "9" * 5000,
        "0." + "3" * 400,
        "1_0",
        "0x1F",
        "1,5",
        "1.5.2",
        "1e",
        "e5",
        "--1",
        "+",
        ".",
    ),
    *(
        "",
        " ",
        "-",
        "null",
        "true",
        "None",
        "\u0661\u0662",
        "\u00bd",
        "\uff11",
        "1\u00a0000",
        "1'000",
        "1\x00",
    ),
)
_CHARACTERS: Final = (
    *(
        "\x00",
        "\x07",
        "\x1b[31m",
        "\x7f",
        "\x85",
        "\x9b",
        "\u00ad",
        "\u200b",
        "\u202e",
        "\u2028",
        "\ufeff",
        "\ufffd",
    ),
    *(
        "\r",
        "\n",
        "\r\n",
        "\t",
        "\v",
        "\f",
        "\x1c",
        "\x1e",
        "\u3000",
        "\u00a0",
        '"',
        "'",
        "#",
        ",",
        ";",
        "%",
        "$",
    ),
    *("{", "}", "[", "]", "=", ":", "\\", "\\u0000", "\U0001f600", "e\u0301", "\U000e0001", "\ue000"),
)
_VALUES: Final = (
    *(
        "null",
        "true",
        "false",
        "0",
        "1",
        "-1",
        "1e999",
        "-1e999",
        "NaN",
        "-Infinity",
        "1e308",
        "5e-324",
        "-0.0",
    ),
    *(
        "9223372036854775808",
        "18446744073709551616",
        "9" * 400,
        "[]",
        "{}",
        '""',
        '"text"',
        '"\\u0000"',
        '"\\ud800"',
    ),
    *(
        '"\\u001b[31m"',
        '"a\\nb"',
        '"' + "x" * 3000 + '"',
        "[[]]",
        "[null]",
        '[""]',
        "[1, 2]",
        "[[1], [2, 3]]",
        "0.5",
    ),
    *(
        '{"": 1}',
        '{"a": {"a": {}}}',
        "1e-300",
        '"nan"',
        '"1"',
        "[" * 3000 + "]" * 3000,
        "[true]",
        '"../../x"',
        "2",
    ),
)
_TOML_VALUES: Final = (
    *(
        "nan",
        "inf",
        "-inf",
        "1e999",
        "1e308",
        "-1",
        "0",
        "1",
        "2",
        "-0.0",
        "5e-324",
        "9223372036854775808",
        "9" * 400,
    ),
    *(
        '""',
        '"text"',
        '"\\u0000"',
        '"\\u001b[31m"',
        '"a\\nb"',
        '"' + "x" * 3000 + '"',
        "[]",
        "{}",
        "[[]]",
        "[1, 2]",
    ),
    *(
        "[[1, 2], [3]]",
        "[[1.0, 0.0], [0.0, 1.0]]",
        "true",
        "false",
        "1979-05-27",
        "07:32:00",
        "1979-05-27T07:32:00Z",
    ),
    *(
        '["a", "b"]',
        "[nan]",
        "[1e308, 1e308]",
        "{ a = 1 }",
        '"/dev/zero"',
        '"."',
        '"1e999 Hz"',
        '"nan s"',
        '"1 kg"',
    ),
    *(
        '"-1 A"',
        '"0.1 g"',
        '"1 ms"',
        "0x7fffffffffffffff",
        "0b1",
        "1_000",
        "[" * 3000 + "]" * 3000,
        "1e12",
        "1e-12",
    ),
)
_WORDS: Final = (
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0x8000,
    0xFFFF,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**63 - 1,
    2**64 - 1,
)
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_RAW: Final = re.compile('"@@(\\d+)@@"')
_ENCODINGS: Final = ("utf-16", "utf-16-le", "utf-32", "latin-1", "cp037", "utf-8-sig", "utf-7")

Random = random.Random


def mutant(name: str, structure: Structure, content: bytes, others: Sequence[bytes], number: int) -> bytes:
    """Damaged copy `number` of the seed `name`; `others` are seeds that parts may come from."""
    rng = Random(f"{name}:{number}")
    change = rng.choice(_CHANGES[structure])
    damaged = change(rng, content, others)
    # One change in most of them, so that its consequence is not hidden by another.
    while rng.random() < 0.3:
        damaged = rng.choice(_CHANGES[structure])(rng, damaged, others)
    return damaged


# Of bytes


def _place(rng: Random, length: int) -> int:
    """A place in a file, more often near its ends, where headers and indices are."""
    where = rng.random()
    if where < 0.35:
        return rng.randrange(min(length, 512)) if length else 0
    if where < 0.55:
        return max(0, length - 1 - rng.randrange(512))
    return rng.randrange(length) if length else 0


def _flipped(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    damaged = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 8)) if damaged else 0):
        damaged[_place(rng, len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def _overwritten(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    width = rng.choice((1, 2, 4, 8))
    place = _place(rng, len(content))
    if rng.random() < 0.5:
        place -= place % width
    value = rng.choice((*_WORDS, rng.getrandbits(64))) % (1 << 8 * width)
    return content[:place] + value.to_bytes(width, rng.choice(("little", "big"))) + content[place + width :]


def _sized(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """With another number where there may be a size: a small whole number in four or eight aligned bytes."""
    order, form = rng.choice("<>"), rng.choice("HIIQ")
    width = struct.calcsize(form)
    for _ in range(40):
        place = _place(rng, len(content)) // 2 * 2
        if place + width > len(content):
            continue
        (value,) = struct.unpack_from(order + form, content, place)
        if 0 < value <= 2 * len(content):
            break
    else:
        return _overwritten(rng, content, others)
    most = (1 << 8 * width) - 1
    other = rng.choice(
        (0, 1, value - 1, value + 1, 2 * value, value + 8, len(content), 1 << 20, 1 << 28, 1 << 31, most)
    )
    return content[:place] + struct.pack(order + form, min(other, most)) + content[place + width :]


def _cut(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    start = _place(rng, len(content))
    return content[:start] + content[start + rng.choice((1, 2, 4, 8, 16, rng.randrange(1, 2000))) :]


def _inserted(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    place = _place(rng, len(content))
    added = rng.randbytes(rng.choice((1, 2, 4, 8, 16, 300)))
    return content[:place] + added + content[place:]


def _repeated(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    start = _place(rng, len(content))
    part = content[start : start + rng.choice((1, 8, 64, 500))]
    return content[:start] + part * rng.choice((2, 3, 20, 2000)) + content[start + len(part) :]


def _truncated(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    return content[: _place(rng, len(content))]


def _spliced(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    other = rng.choice(others) if others else content
    start, end = _place(rng, len(content)), _place(rng, len(other))
    return (
        content[:start]
        + other[end : end + rng.choice((8, 64, 10**9))]
        + content[start + rng.choice((0, 8, 64)) :]
    )


def _zeroed(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    start, length = _place(rng, len(content)), rng.choice((4, 16, 512, 4096))
    part = content[start : start + length]
    return content[:start] + bytes([rng.choice((0, 255, 32))]) * len(part) + content[start + len(part) :]


_OF_BYTES: Final = (_flipped, _overwritten, _sized, _cut, _inserted, _repeated, _truncated, _spliced, _zeroed)


# Of text


def _of_text(change: Callable[[Random, str], str]) -> Callable[[Random, bytes, Sequence[bytes]], bytes]:
    def changed(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
        text = content.decode("utf-8", "surrogateescape")
        return change(rng, text).encode("utf-8", "surrogateescape")

    changed.__name__ = change.__name__
    return changed


def _with_number(rng: Random, text: str) -> str:
    found = None
    for _ in range(20):
        found = _NUMBER.search(text, _place(rng, len(text)))
        if found is not None:
            break
    if found is None:
        return text
    other = rng.choice((*_NUMBERS, str(rng.uniform(-10.0, 10.0)), found[0] + "0", "-" + found[0]))
    everywhere = rng.random() < 0.1
    return (
        text.replace(found[0], other) if everywhere else text[: found.start()] + other + text[found.end() :]
    )


def _with_character(rng: Random, text: str) -> str:
    place = _place(rng, len(text))
    added = rng.choice(_CHARACTERS) * rng.choice((1, 1, 1, 2, 50, 5000))
    return text[:place] + added + text[place + rng.choice((0, 1)) :]


def _with_lines(rng: Random, text: str) -> str:
    lines = text.split("\n")
    first, second = sorted((min(rng.choice((3, 30, len(lines))), len(lines)) - 1, rng.randrange(len(lines))))
    first = rng.randint(0, max(first, 0))
    match rng.randrange(6):
        case 0:
            del lines[first]
        case 1:
            del lines[first : second + 1]
        case 2:
            lines[first:first] = [lines[second]] * rng.choice((1, 1, 2, 300))
        case 3:
            lines[first], lines[second] = lines[second], lines[first]
        case 4:
            lines[first] = lines[first] * rng.choice((2, 3, 500))
        case _:
            lines.reverse()
    return "\n".join(lines)


def _with_fields(rng: Random, text: str) -> str:
    """Fields of a line lost, doubled, swapped or moved to another delimiter."""
    lines = text.split("\n")
    number = rng.randrange(min(len(lines), rng.choice((1, 3, 30, 10**6))))
    delimiter = rng.choice(
        [each for each in (",", "\t", ";", " ", "=", ":") if each in lines[number]] or [","]
    )
    fields = lines[number].split(delimiter)
    place = rng.randrange(len(fields))
    match rng.randrange(6):
        case 0:
            del fields[place]
        case 1:
            fields[place:place] = [fields[place]] * rng.choice((1, 1, 3, 2000))
        case 2:
            other = rng.randrange(len(fields))
            fields[place], fields[other] = fields[other], fields[place]
        case 3:
            fields[place] = rng.choice(_NUMBERS)
        case 4:
            fields[place] += rng.choice(_CHARACTERS)
        case _:
            new = rng.choice((",", "\t", ";", " ", "|", ""))
            if rng.random() < 0.5:
                return text.replace(delimiter, new)
            lines[number] = new.join(fields)
            return "\n".join(lines)
    lines[number] = delimiter.join(fields)
    return "\n".join(lines)


def _with_word(rng: Random, text: str) -> str:
    """A word of the text in the place of another one, or as it was with one letter changed."""
    words = list(re.finditer(r"\w{2,}", text[: rng.choice((200, 2000, 100_000))]))
    if not words:
        return text
    here, there = rng.choice(words), rng.choice(words)
    other = rng.choice(
        (there[0], here[0].upper(), here[0][:-1], here[0] + rng.choice(_CHARACTERS), "x" * 3000)
    )
    return text[: here.start()] + other + text[here.end() :]


def _encoded(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    text = content.decode("utf-8", "replace")
    match rng.randrange(3):
        case 0:
            return text.encode(rng.choice(_ENCODINGS), "replace")
        case 1:
            return text.replace("\n", rng.choice(("\r", "\r\n", "\r\r\n", "\n\n", "\u2028", "\x0b"))).encode()
        case _:
            return (
                rng.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff", b"\n" * 50, b" ", b"\x1a")) + content
            )


_LINES: Final = tuple(
    _of_text(change) for change in (_with_number, _with_character, _with_lines, _with_fields, _with_word)
)
_OF_TEXT: Final = (*_LINES, *_LINES, _encoded, _flipped, _cut, _repeated, _truncated, _spliced, _overwritten)


# Of keys


def _changed_value(rng: Random, tree: Any) -> tuple[Any, str]:
    """A JSON value with one place changed, and the text that stands for `_RAW`."""
    # Few of the places are numbers of a long list.
    all_places = places(tree)
    raw = rng.choice(_VALUES)
    if not all_places:
        return "@@0@@", raw
    of_containers = [
        place
        for place in all_places
        if isinstance(place.container[place.key], dict | list) or isinstance(place.container, dict)
    ]
    _, container, key = rng.choice(of_containers if of_containers and rng.random() < 0.7 else all_places)
    value = container[key]
    match rng.randrange(8):
        case 0 | 1 | 2:
            container[key] = "@@0@@"
        case 3:
            del container[key]
        case 4:
            _, other, there = rng.choice(all_places)
            container[key], other[there] = other[there], value
        case 5 if isinstance(container, dict):
            container[rng.choice((str(key) + "_", "", str(key).upper(), "a\nb", "\x1b"))] = container.pop(key)
        case 6 if isinstance(value, list):
            container[key] = value[: len(value) // 2] if rng.random() < 0.5 else value * rng.choice((2, 300))
        case 7 if isinstance(value, int | float):
            container[key] = rng.choice(
                (-value, 0, value * 1e6, value * 1e-6, value + 1, int(value), float(value))
            )
        case _:
            container[key] = rng.choice(
                (None, "", [], {}, [value], {"a": value}, str(value)[:100], 0.5, True)
            )
    return tree, raw


def _json_text(rng: Random, tree: Any, **layout: Any) -> str:
    tree, raw = _changed_value(rng, tree)
    return _RAW.sub(lambda _: raw, json.dumps(tree, **layout))


def _of_json(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    try:
        return _json_text(rng, json.loads(content)).encode("utf-8", "replace")
    except (ValueError, RecursionError, OverflowError):
        return _flipped(rng, content, others)


def _doubled_key(rng: Random, text: str) -> str:
    keys = list(re.finditer(r'"\w+": ', text))
    if not keys:
        return text
    here, there = rng.choice(keys), rng.choice(keys)
    return text[: here.start()] + there[0] + rng.choice(_VALUES) + ", " + text[here.start() :]


_OF_JSON: Final = (
    *(_of_json,) * 8,
    _of_text(_doubled_key),
    _of_text(_with_number),
    _of_text(_with_character),
    *_OF_BYTES,
)


def _of_toml(rng: Random, text: str) -> str:
    lines = text.split("\n")
    keys = [number for number, line in enumerate(lines) if "=" in line]
    tables = [number for number, line in enumerate(lines) if line.startswith("[")]
    if not keys or not tables:
        return text
    here, there = rng.choice(keys), rng.choice(keys)
    key, _, value = lines[here].partition("=")
    match rng.randrange(10):
        case 0 | 1 | 2:
            lines[here] = f"{key}= {rng.choice(_TOML_VALUES)}"
        case 3:
            lines[here] = f"{key}={lines[there].partition('=')[2]}"
        case 4:
            lines[here] = f"{lines[there].partition('=')[0]}={value}"
        case 5:
            lines[here] = rng.choice(
                (f"{key}.a={value}", f"{key} = [{value}]", f'"{key.strip()}\\n"={value}', "a." * 200 + "b=1")
            )
        case 6:
            lines.insert(rng.choice(tables), rng.choice(lines))
        case 7:
            place = rng.choice(tables)
            name = lines[place].strip("[]")
            lines[place] = rng.choice(
                (f"[{name}]", f"[[{name}]]", f"[{name}.a]", f"[[{name}.a]]", f"[{name}s]", "")
            )
        case 8:
            first, last = sorted((rng.choice(tables), rng.choice(tables)))
            block = lines[first:last]
            lines[first:first] = block * rng.choice((1, 1, 20))
        case _:
            lines.insert(
                here, f"{rng.choice(('x', key.strip(), 'name', 'a b'))} = {rng.choice(_TOML_VALUES)}"
            )
    return "\n".join(lines)


_OF_TOML: Final = (*(_of_text(_of_toml),) * 10, *_OF_TEXT)


# Of what is checked or compressed


def _of_journal(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A line with another value under a checksum that is right, as a forger or a fault of memory writes it."""
    lines = content.split(b"\n")
    number = rng.randrange(len(lines))
    body, _, _ = lines[number].rpartition(b', "crc32": "')
    try:
        text = _json_text(rng, json.loads(body + b"}"), ensure_ascii=False)[:-1].encode("utf-8", "replace")
    except (ValueError, RecursionError, OverflowError):
        return _flipped(rng, content, others)
    lines[number] = text + f', "crc32": "{zlib.crc32(text):08x}"}}'.encode()
    return b"\n".join(lines)


def _swapped_lines(rng: Random, text: str) -> str:
    return _with_lines(rng, text)


_OF_JOURNAL: Final = (*(_of_journal,) * 10, _of_text(_swapped_lines), *_OF_BYTES)


def _of_matlab(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A change within a compressed element of a version 5 file."""
    places = [
        place for place in range(128, len(content) - 8, 1) if content[place : place + 4] == b"\x0f\0\0\0"
    ]
    if not places:
        return rng.choice(_OF_BYTES)(rng, content, others)
    place = rng.choice(places)
    (size,) = struct.unpack_from("<I", content, place + 4)
    try:
        plain = zlib.decompress(content[place + 8 : place + 8 + size])
    except zlib.error:
        return _flipped(rng, content, others)
    # The header of a matrix is short.
    head = rng.choice((64, 96, len(plain)))
    changed = rng.choice(_OF_BYTES)(rng, plain[:head], others) + plain[head:]
    packed = zlib.compress(changed)
    return content[:place] + struct.pack("<2I", 15, len(packed)) + packed + content[place + 8 + size :]


_OF_MATLAB: Final = (*(_of_matlab,) * 4, *_OF_BYTES)


def _of_zip(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A change within a member of an archive, lost, doubled or renamed members."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [(each.filename, archive.read(each)) for each in archive.infolist()]
    except Exception:  # what damaged archives lead the library to
        return _flipped(rng, content, others)
    if not members:
        return _flipped(rng, content, others)
    place = rng.randrange(len(members))
    name, inside = members[place]
    match rng.randrange(8):
        case 0:
            del members[place]
        case 1:
            members[place] = (rng.choice((name + "x", "", "../" + name, name * 100, "a\nb.npy")), inside)
        case 2:
            members.append(members[place])
        case 3:
            members[place] = (name, rng.choice(members)[1])
        case _:
            head = rng.choice((128, len(inside)))
            members[place] = (name, rng.choice(_OF_BYTES)(rng, inside[:head], others) + inside[head:])
    damaged = io.BytesIO()
    with zipfile.ZipFile(damaged, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
        for name, inside in members:
            archive.writestr(zipfile.ZipInfo(name or "x"), inside)
    return damaged.getvalue()


_OF_ZIP: Final = (*(_of_zip,) * 6, *_OF_BYTES)

_CHANGES: Final[dict[Structure, Sequence[Callable[[Random, bytes, Sequence[bytes]], bytes]]]] = {
    "text": _OF_TEXT,
    "json": _OF_JSON,
    "toml": _OF_TOML,
    "journal": _OF_JOURNAL,
    "binary": _OF_BYTES,
    "matlab": _OF_MATLAB,
    "zip": _OF_ZIP,
}
