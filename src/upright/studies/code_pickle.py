"""Pickles definitions of the main module by value; errors in them still name file and line.

cloudpickle does the work, but gives all code the same file name.
"""

import io
from collections import ChainMap
from types import CodeType
from typing import Any, ClassVar

import cloudpickle

_reduce: Any = cloudpickle.Pickler.dispatch_table[CodeType]


def _make_code(file: str, make: type[CodeType], parts: tuple[Any, ...]) -> CodeType:
    return make(*parts).replace(co_filename=file)


def _reduce_code(code: CodeType) -> tuple[Any, ...]:
    return _make_code, (code.co_filename, *_reduce(code))


class _Pickler(cloudpickle.Pickler):  # type: ignore[misc] # it has no types
    dispatch_table: ClassVar[Any] = ChainMap(
        {CodeType: _reduce_code}, cloudpickle.Pickler.dispatch_table
    )


def dumps(thing: object) -> bytes:
    """Return what `pickle.loads` makes again in a process that cannot import the main module."""
    output = io.BytesIO()
    _Pickler(output).dump(thing)
    return output.getvalue()
