"""Whatever a text says, it is accepted or refused by an UprightError of one line."""

import argparse
import json
from contextlib import contextmanager, redirect_stderr, suppress
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from upright.agents import AGENTS
from upright.agents.checks.names import agents_in
from upright.commands import COMMANDS, make_parser, run
from upright.commands.check import classes_in
from upright.core.conditions import CONDITION_TERMS, NOISE_TERMS
from upright.core.parameters import Parameters, parse_parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.pictures.size import parse_size
from upright.plants import PLANTS
from upright.plants.custom import plants_in
from upright.studies.case import make_case
from upright.studies.matlab_twin import TwinJob, _runs_of
from upright.support.numbers import whole_number
from upright.support.settings import (
    change_settings,
    numbers_in,
    sweep_settings,
    values_of,
    with_values,
)

ANY = st.text(max_size=30) | st.text("0123456789.,:=+-eE_()[]% \t'\"xlog", max_size=30)
NUMBERS = st.floats().map(repr) | st.integers().map(str) | st.sampled_from(["1e400", "-0", "1_000"])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | ANY,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(ANY, inner, max_size=3),
    max_leaves=8,
)
"""What JSON and TOML may hold."""
TERMS = st.sampled_from([*NOISE_TERMS, *CONDITION_TERMS])
ONE_TERM = st.one_of(ANY, TERMS, st.builds("{}={}".format, TERMS, NUMBERS | ANY))
TASK_TEXTS = st.lists(ONE_TERM, max_size=3).flatmap(
    lambda terms: st.sampled_from(",+").map(lambda sign: sign.join(terms))
)
JOB = TwinJob("q-learning", "default", "none", "random", 600, 1000, 0, (0, 1))


@contextmanager
def refused_or_not():
    """Let an UprightError of one line pass."""
    try:
        yield
    except UprightError as error:
        if "\n" in str(error):
            raise


@given(TASK_TEXTS, TASK_TEXTS)
def test_terms(noise, condition):
    with refused_or_not():
        spec = TaskSpec(noise, condition=condition)
        assert TaskSpec.from_data(json.loads(json.dumps(spec.as_data()))) == spec


@pytest.mark.parametrize("text", ["delay-1=1+1", "nominal=", "gaussian-0.1=0.1", "none=1"])
def test_cases_have_no_size(text):
    for kind in ("noise", "condition"):
        with pytest.raises(UprightError):
            TaskSpec(**{kind: text})


@given(
    st.lists(st.builds("{}={}".format, st.sampled_from(Parameters._fields) | ANY, NUMBERS | ANY))
)
def test_parameters(texts):
    with refused_or_not():
        TaskSpec(parameters=parse_parameters(texts))


@given(ANY | st.builds("{}:{}:{}".format, NUMBERS, NUMBERS, NUMBERS | ANY))
def test_numbers_and_ranges(text):
    for read in (whole_number, parse_size, lambda text: numbers_in("x", text)):
        with refused_or_not():
            read(text)


@pytest.mark.parametrize(
    ("registry", "name"), [(r, n) for r in (AGENTS, PLANTS) for n in r.built_in]
)
@settings(max_examples=40)
@given(data=st.data())
def test_settings(registry, name, data):
    default = registry.default(name)
    setting = data.draw(st.sampled_from([*values_of(default), "no_such"]))
    text = data.draw(ANY | NUMBERS)
    with refused_or_not():
        change_settings(default, {setting: text})
    with refused_or_not():
        sweep_settings(default, {setting: text})
    with refused_or_not():
        with_values(default, {setting: data.draw(VALUES)})


@given(ANY | st.builds("{}:{}".format, ANY, ANY))
def test_names(name):
    with refused_or_not():
        make_case(f"{name}:no-such-name")
    with refused_or_not():
        AGENTS.check(name)
        PLANTS.check(name)


def leaves(parser):
    """Yield the parsers of commands below one, each with the words that lead there."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, child in action.choices.items():
                for words, leaf in leaves(child):
                    yield [name, *words], leaf
            return
    yield [], parser


@pytest.mark.parametrize("command", list(COMMANDS))
@settings(max_examples=15)
@given(data=st.data())
def test_options(command, data):
    for words, leaf in leaves(make_parser([command])):
        needed = ["x" for action in leaf._actions if not action.option_strings and action.required]
        flags = [action for action in leaf._actions if action.option_strings]
        action = data.draw(st.sampled_from(flags))
        given_words = [*words, *needed, action.option_strings[-1], data.draw(ANY | NUMBERS)]
        with suppress(SystemExit), refused_or_not(), redirect_stderr(StringIO()):
            make_parser([command]).parse(given_words)


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_code_is_only_read(text):
    path = Path("odd.py")
    path.write_bytes(text)
    agents_in(path), plants_in(path), classes_in(path)


LINES = st.text(max_size=40) | st.builds(
    "upright {}\n".format,
    st.dictionaries(st.sampled_from(["run", "success", "lengths", "seconds"]), VALUES).map(
        json.dumps
    )
    | st.text(max_size=40),
)


@given(st.lists(LINES, max_size=3))
def test_lines_of_the_matlab_twin(lines):
    with refused_or_not():
        list(_runs_of(iter(lines), JOB))


@pytest.fixture(autouse=True, scope="module")
def _here(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("here"))
        yield


@pytest.mark.parametrize("words", [["--plant", "gazebo"], ["--x", "ros2"], ["ros2", "--x"]])
def test_an_option_without_a_command_is_refused(words, capsys):
    with pytest.raises(SystemExit) as ended:
        run(words)
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
