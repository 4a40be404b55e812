"""Inputs for tools/fuzz.py: valid ones, damaged at random.

Bytes are flipped, cut, copied and replaced; in JSON and in NumPy archives, so are whole values, so
that what stands behind the first check is reached too.
"""

import io
import json
import random
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

ODD_BYTES = (
    *(b"", b"\0", b"\n", b"\xff", b"\xed\xa0\x80", b"\x1b[2J", b"\xef\xbb\xbf", b"%", b"'", b'"'),
    *(b"-1", b"0", b"1e308", b"1e-320", b"nan", b"inf", b"9" * 400, b"18446744073709551616"),
    *(b"true", b"null", b"[]", b"{}", b"(" * 200, b"[" * 2000, b"../../x", b"/dev/zero", b"=1+1"),
    *(b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"PK\3\4", b"x" * 300),
)
"""What is put into any input."""
ODD_VALUES: tuple[Any, ...] = (
    *(None, True, False, "", "x", "\0", "\ud800", "a\nb", "x" * 300, "nan", "0.1", "os:abort"),
    *(0, -1, 1, 2, 255, 2**31, 2**53 + 1, 2**63 - 1, 2**63, -(2**63), 10**18, 10**400),
    *(0.0, -0.0, 0.5, 1e-320, 1e30, 1e308, -1e308, float("nan"), float("inf")),
    *([], {}, [[]], [0.0] * 300, {"": 0}, {"object": "x", "attributes": {}}, {"array": 0}),
)
"""What is put in place of a value of JSON."""


def damaged(rng: random.Random, seeds: Sequence[bytes], words: Sequence[bytes]) -> bytes:
    """Return one of the seeds, damaged; words are put in as well as odd bytes."""
    data = rng.choice(seeds)
    if rng.random() < 0.7:
        for begins, damage in ((b"PK", damaged_archive), (b"{", damaged_json)):
            if data.startswith(begins):
                with suppress(Exception):  # a part of it was damaged before, and cannot be read
                    return damage(rng, data)
    return damaged_bytes(rng, data, seeds, words)


def damaged_bytes(
    rng: random.Random, data: bytes, seeds: Sequence[bytes], words: Sequence[bytes]
) -> bytes:
    """Return bytes after some edits."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        start = rng.randrange(len(changed) + 1)
        end = min(len(changed), start + rng.choice((0, 1, 1, 4, 8, 32, 256)))
        match rng.randrange(6):
            case 0:
                for place in range(start, min(end, start + 4)):
                    changed[place] ^= 1 << rng.randrange(8)
            case 1:
                changed[start:end] = rng.randbytes(rng.choice((1, 1, 2, 4, 8)))
            case 2:
                changed[start:end] = rng.choice((*ODD_BYTES, *words))
            case 3:
                changed[start:end] = b""
            case 4:
                changed[start:start] = changed[start:end] * rng.choice((1, 2, 30))
            case 5:
                other = rng.choice(seeds)
                cut = rng.randrange(len(other) + 1)
                changed[start:end] = other[cut : cut + rng.choice((1, 8, 64, 10**6))]
    return bytes(changed)


def damaged_json(rng: random.Random, data: bytes) -> bytes:
    """Return JSON with some values replaced, moved, renamed or removed."""
    value = json.loads(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        value = _changed(rng, value, value)
    return json.dumps(value).encode()


def _changed(rng: random.Random, value: Any, whole: Any) -> Any:
    """Return a value that is changed in one place."""
    if not isinstance(value, (list, dict)) or not value or rng.random() < 0.1:
        return rng.choice((_odd(rng, value), _part(rng, whole)))
    places = list(value) if isinstance(value, dict) else range(len(value))
    place = rng.choice(places)
    match rng.randrange(8):
        case 0:
            return (
                {k: v for k, v in _pairs(value) if k != place}
                if isinstance(value, dict)
                else ([v for k, v in _pairs(value) if k != place])
            )
        case 1 if isinstance(value, list):
            return [*value, *value[: rng.choice((1, 2, 10**4))]]
        case 1:
            return {
                rng.choice((k, k.upper(), "")) if k == place else k: v for k, v in _pairs(value)
            }
    changed = dict(value) if isinstance(value, dict) else list(value)
    changed[place] = _changed(rng, value[place], whole)
    return changed


def _pairs(value: Any) -> list[tuple[Any, Any]]:
    return list(value.items() if isinstance(value, dict) else enumerate(value))


def _odd(rng: random.Random, value: Any) -> Any:
    """Return something in place of a value: near it, or odd."""
    if isinstance(value, (int, float)) and abs(value) < 1e300 and rng.random() < 0.5:
        return rng.choice((-value, value + 1, value - 1, value * 1e8, value * 1e-30, int(value)))
    if isinstance(value, str) and value and rng.random() < 0.5:
        return rng.choice((value[:-1], value + "x", value.upper(), value + ",delay=1", value * 50))
    return rng.choice(ODD_VALUES)


def _part(rng: random.Random, value: Any) -> Any:
    """Return some part of a value."""
    while isinstance(value, (list, dict)) and value and rng.random() < 0.8:
        value = rng.choice([part for _, part in _pairs(value)])
    return value


def damaged_archive(rng: random.Random, data: bytes) -> bytes:
    """Return a NumPy archive with some members replaced, renamed, repeated or removed."""
    members = unpacked(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        place = rng.randrange(len(members)) if rng.random() < 0.5 else 0
        name, content = members[place]
        match rng.randrange(8):
            case 0:
                del members[place]
            case 1:
                members.append((name, content))
            case 2:
                members[place] = (
                    rng.choice((name.upper(), "x.npy", "../x", *dict(members))),
                    content,
                )
            case 3:
                content = damaged_bytes(rng, content, [content], ())
                members[place] = name, content
            case _:
                members[place] = name, _damaged_array(rng, content)
        if not members:
            break
    return packed(
        members, rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    )


def _damaged_array(rng: random.Random, content: bytes) -> bytes:
    """Return a member of an archive with its text, or its numbers, its type or shape changed."""
    array = np.load(io.BytesIO(content), allow_pickle=False)
    if array.shape == () and array.dtype.kind in "SU":
        text = array.item()
        data = text if isinstance(text, bytes) else text.encode(errors="surrogatepass")
        text = damaged_json(rng, data)
        return saved(np.array(text if array.dtype.kind == "S" else text.decode()))
    match rng.randrange(4):
        case 0:
            return saved(array.astype(rng.choice(("f4", "f8", "i4", "i8", "u1", "?", "c8", "S3"))))
        case 1:
            return saved(array.reshape(rng.choice(((-1,), (1, -1), array.shape[::-1]))))
        case 2 if array.size:
            return saved(np.resize(array, rng.choice((0, 1, array.size + 1, 2 * array.size))))
    changed = array.copy()
    if array.size:
        places = rng.sample(range(array.size), min(array.size, rng.choice((1, 3, 10**6))))
        odd = (
            (0, -1, 1, 10**6, 2**62, -(2**63))
            if array.dtype.kind in "iu"
            else (*(0.0, -1.0, 1e308, -1e308, 1e-320, float("nan"), float("inf"), 1e10),)
        )
        with np.errstate(all="ignore"):
            changed.ravel()[places] = np.array(rng.choice(odd)).astype(array.dtype)
    return saved(changed)


def saved(array: np.ndarray) -> bytes:
    """Return an array as a member of an archive."""
    written = io.BytesIO()
    np.lib.format.write_array(written, array, version=(1, 0), allow_pickle=False)
    return written.getvalue()


def unpacked(data: bytes) -> list[tuple[str, bytes]]:
    """Return the names and contents of an archive's members."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(info.filename, archive.read(info)) for info in archive.infolist()]


def packed(members: Sequence[tuple[str, bytes]], packing: int = zipfile.ZIP_STORED) -> bytes:
    """Return an archive of these members, which does not depend on the time."""
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", packing) as archive:
        for name, content in members:
            info = zipfile.ZipInfo(name)
            info.compress_type = packing
            archive.writestr(info, content)
    return written.getvalue()
