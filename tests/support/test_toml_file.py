import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from upright.errors import AgentError, UprightError, require
from upright.support.toml_file import MOST_WORK, read_toml, toml_text, toml_value

TEXT = '''\
# half_length = 0: a comment is no key
title = """
half_length = 1
[parameters]
"""  # of several lines
list = [
    1,
    # half_length = 2
]
"quoted key" = 1
'single' = 2
dotted . "of two" = 3
inline = { half_length = 4, "in\\u006eer" = { deep = 5 } }

[ parameters ]  # a header with spaces
"half\\u005flength" = [
  6,
]
[parameters.within]
key = 7
[[several]]
half_length = 8
[[several]]
half_length = 9
'''


@pytest.fixture
def file_of(tmp_path):
    """Return a function that writes and reads a file."""

    def read(text):
        path = tmp_path / "mine.toml"
        path.write_bytes(text.encode())
        return read_toml(path, "test file")

    return read


def test_a_number_that_python_does_not_write_is_refused(file_of):
    with pytest.raises(UprightError, match="it is not TOML: Exceeds the limit"):
        file_of("steps = 0x" + "f" * 5000)


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (("title",), 2),
        (("list",), 6),
        (("quoted key",), 10),
        (("single",), 11),
        (("dotted",), 12),
        (("dotted", "of two"), 12),
        (("inline", "half_length"), 13),
        (("inline", "inner", "deep"), 13),
        (("parameters",), 15),
        (("parameters", "half_length"), 16),
        (("parameters", "within"), 19),
        (("parameters", "within", "key"), 20),
        (("several",), 21),
        (("several", 0), 21),
        (("several", 0, "half_length"), 22),
        (("several", 1, "half_length"), 24),
        (("several", 2), None),
        (("list", "half_length"), None),
        (("several", "half_length"), None),
        (("half_length",), None),
        (("title", "half_length"), None),
        ((), None),
    ],
)
def test_a_key_is_found_on_its_line(keys, line, ending, file_of):
    assert file_of(TEXT.replace("\n", ending)).line_of(*keys) == line


def test_in_a_file_that_takes_long_to_search_the_key_is_named_alone(file_of):
    file = file_of("steps = 0\n" + "\n" * int(MOST_WORK**0.5))
    assert str(file.error("no", "steps")).endswith("mine.toml'; steps: no")


def test_an_error_names_the_value_that_is_refused_by_itself(file_of):
    def check(values):
        for name, value in values.items():
            require(name, value, 0)
        if sum(values.values()) > 10:
            raise UprightError("too much")
        return sum(values.values())

    file = file_of("[sizes]\na = 1\n'b c' = -1\nd = 11\n")
    assert file.checked(check, {"a": 1}) == 1
    with pytest.raises(UprightError, match=r'; line 3, sizes\."b c": b c is -1; it must be'):
        file.checked(check, file.content["sizes"], "sizes")
    with pytest.raises(UprightError, match=r"; line 1, sizes: too much$"):
        file.checked(check, {"a": 6, "d": 6}, "sizes")


def test_an_error_names_the_place_in_an_array_of_tables(file_of):
    file = file_of("[[a]]\n[[a]]\n'b c' = 1\n")
    with (
        pytest.raises(UprightError, match=r'; line 3, a\[1\]\."b c": it is wrong$'),
        file.at("a", 1, "b c"),
    ):
        raise UprightError("it is wrong")


def test_errors_of_custom_code_pass_as_they_are(file_of):
    file = file_of("a = 1\n")
    with pytest.raises(AgentError, match=r"^it failed$"), file.at("a"):
        raise AgentError("it failed")


def test_a_mark_at_the_beginning_is_no_part_of_the_text(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xef\xbb\xbfsteps = 1\n")
    assert read_toml(path, "file").content == {"steps": 1}


VALUES = st.recursive(
    st.text(max_size=20) | st.booleans() | st.integers() | st.floats(allow_nan=False),
    lambda inner: st.lists(inner, max_size=3),
)


@settings(max_examples=50)
@given(VALUES)
def test_values_are_read_back_as_they_were_written(value):
    again = tomllib.loads(f"value = {toml_value(value)}")["value"]
    assert repr(again) == repr(value)


TREES = st.recursive(
    VALUES, lambda inner: st.dictionaries(st.text(max_size=8), inner, max_size=3), max_leaves=8
)


@settings(max_examples=50)
@given(st.dictionaries(st.text(max_size=8), TREES, max_size=4))
def test_tables_are_read_back_as_they_were_written(content):
    assert repr(tomllib.loads(toml_text(content))) == repr(in_order(content))


def in_order(content):
    """Return tables with what stands in tables of its own after all else."""
    tables = {name: in_order(value) for name, value in content.items() if isinstance(value, dict)}
    return {name: value for name, value in content.items() if name not in tables} | tables
