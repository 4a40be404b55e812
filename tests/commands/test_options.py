"""Over every command: what its help says, which names it allows, what it answers to others."""

import argparse
import doctest
import json
import re
import shlex
import subprocess
import sys
from dataclasses import replace

import pytest
from helpers import ROOT, python

import upright.errors
from upright import __version__
from upright.agents import AGENTS, LABELS
from upright.commands import COMMANDS, make_parser, run
from upright.commands.completion import actions
from upright.commands.options import (
    add_case_options,
    add_task_options,
    cases_of,
    task_of,
)
from upright.commands.parser import Parser, as_whole
from upright.commands.ros2.fields import given
from upright.core.conditions import CONDITIONS, NOISES, STARTS, STEPS, TRIALS
from upright.core.parameters import Parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.nodes.settings import SIMULATED, SimulatorSettings
from upright.plants import PLANTS
from upright.reports.tables import FORMATS
from upright.studies import matlab_twin
from upright.support.exit_status import BAD_USE


def commands(parser, name=""):
    """Give the name and the parser of every command, those that have others below them too."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for word, below in action.choices.items():
                yield f"{name} {word}".strip(), below
                yield from commands(below, f"{name} {word}".strip())


ALL = dict(commands(make_parser()))
LEAVES = {name: parser for name, parser in ALL.items() if parser.get_default("command")}


def examples(text):
    """Return the command lines in the end of a command's help, without the comments beside them."""
    lines = [line.strip() for line in text.splitlines() if line.startswith("  ")]
    return [line.split("  ")[0].split(" > ")[0] for line in lines if line.startswith("upright ")]


def shown_by(line, capsys):
    """Return what a command line that ends by itself prints."""
    with pytest.raises(SystemExit) as ended:
        run(line.split())
    assert ended.value.code == 0
    return capsys.readouterr().out


# ------------------------------------------------------------------------------ help


def test_there_are_commands_and_some_have_others_below_them():
    assert set(COMMANDS) <= set(ALL)
    assert {"matlab table", "ros2 demo", "gazebo view"} <= set(LEAVES)


def test_the_help_lists_every_command_with_its_summary(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    shown = shown_by("--help", capsys)
    for name in COMMANDS:
        summary = ALL[name].description.partition("\n")[0]
        assert f" {name} " in shown or f" {name}\n" in shown
        assert summary.removesuffix(".") in shown


@pytest.mark.parametrize("name", ALL)
def test_help_describes_the_command_and_teaches_by_example(name, capsys):
    shown = shown_by(f"{name} --help", capsys)
    assert ALL[name].description.partition("\n")[0] in shown
    assert ALL[name].description[0].isupper()
    assert "examples" in shown
    assert f"upright {name}" in shown.partition("examples")[2]


@pytest.mark.parametrize("name", ALL)
def test_every_option_has_a_help_text(name):
    without = [action.dest for action in ALL[name]._actions if not action.help]
    assert without == ["==SUPPRESS=="] * (name not in LEAVES)  # the commands below it


@pytest.mark.parametrize("name", ["", *ALL])
def test_every_example_can_be_parsed(name):
    parser = ALL[name] if name else make_parser()
    lines = examples(parser.epilog)
    assert lines
    for line in lines:
        options = make_parser().parse(shlex.split(line)[1:])
        assert callable(options.command), line


@pytest.mark.parametrize("name", LEAVES)
def test_a_command_gets_its_own_options_and_no_more(name):
    parser = LEAVES[name]
    own = {action.dest for action in parser._actions}
    needed = [action for action in parser._actions if not action.option_strings]
    needed = [action for action in needed if action.nargs != "?" or action.metavar == "AGENT"]
    words = [next(iter(each.choices)) if each.choices else f"x{n}" for n, each in enumerate(needed)]
    given = vars(make_parser().parse([*name.split(), *words]))
    assert given.keys() - {"command", "parser", "check"} <= own


def test_only_the_module_of_the_command_asked_for_is_imported():
    code = "import sys; from upright.commands import COMMANDS, run\n"
    code += "try: run(['plants', '--help'])\nexcept SystemExit: pass\n"
    code += "print([name for name, place in COMMANDS.items() if place in sys.modules])"
    assert python(code).stdout.endswith("\n['plants']\n")


def test_the_package_can_be_run_as_a_program():
    line = [sys.executable, "-m", "upright", "--version"]
    ended = subprocess.run(line, capture_output=True, text=True, check=True)
    assert ended.stdout == f"upright {__version__}\n"


# ------------------------------------------------------------------------------ names


EXCEPTIONS = {
    "cite --format": ("text",),
    "terms --format": ("text", "markdown"),
    "matlab table --agents": matlab_twin.AGENTS,
    "ros2 simulate --plant": SIMULATED,
    "ros2 demo --plant": SIMULATED,
}
"""Where fewer names are allowed."""


@pytest.mark.parametrize(
    ("flag", "names"),
    [
        ("--noise", NOISES),
        ("--start", STARTS),
        ("--condition", CONDITIONS),
        ("--plant", PLANTS),
        ("--noises", NOISES),
        ("--format", FORMATS),
        ("--agents", AGENTS),
    ],
)
def test_help_names_what_is_allowed(flag, names, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    having = [name for name, parser in LEAVES.items() if flag in parser._option_string_actions]
    assert having
    for name in having:
        shown = shown_by(f"{name} --help", capsys)
        (line,) = [line for line in shown.splitlines() if line.startswith(f"  {flag} ")]
        wanted = set(names) & set(EXCEPTIONS.get(f"{name} {flag}", names))
        assert {n for n in names if n in line} == wanted, line


def test_the_names_of_settings_are_those_that_agents_have():
    assert {label for agent in AGENTS for label in AGENTS.settings(agent)} == set(LABELS)


def test_options_of_a_task_are_read_back():
    parser = Parser()
    add_task_options(parser)
    assert TaskSpec.from_data(task_of(parser.parse([]))) == TaskSpec()
    line = "--noise all-5 --start zero --condition delay-1 --steps 7 --trials 3"
    line += " --parameter half_length=1 --parameter force=12.5"
    parameters = Parameters(half_length=1.0, force=12.5)
    wanted = TaskSpec("all-5", "zero", "delay-1", 7, 3, parameters)
    assert TaskSpec.from_data(task_of(parser.parse(line.split()))) == wanted


LAST_ARGUMENTS = {"learn": ["reinforce"], "tune": ["reinforce"], "play": ["policy.npz"]}


@pytest.mark.parametrize(
    "command",
    ["learn", "table", "play", "tune", "leaderboard", "robust", "ros2 simulate", "ros2 demo"],
)
def test_every_parameter_of_the_plant_can_be_set(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    shown = shown_by(f"{command} --help", capsys)
    for name in Parameters._fields if "ros2" not in command else ():
        assert f"{name} [" in shown
    line = [*command.split(), *LAST_ARGUMENTS.get(command, [])]
    line += ["--parameter", "half_length=1.0", "--parameter", "pole-mass=0.2"]
    options = make_parser().parse(line)
    assert options.parameters == ["half_length=1.0", "pole-mass=0.2"]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("half_length", "--parameter is 'half_length'; it must be NAME=VALUE"),
        ("length=1", "parameter is 'length'; it must be one of gravity"),
        ("half_length=long", "half_length is 'long'; it must be a number"),
        ("half_length=-1", "half_length is -1.0; it must be a number, at least 1e-12"),
        ("half_length=nan", "half_length is nan; it must be a number, at least 1e-12"),
    ],
)
def test_an_impossible_parameter_is_refused_by_name(text, named, capsys):
    assert run(["learn", "random-search", "--parameter", text]) == BAD_USE
    assert named in capsys.readouterr().err


def test_options_of_a_trained_task_are_read_back_where_they_are_given():
    parser = Parser()
    add_task_options(parser, ("--noise", "--start"), as_trained=True)
    assert task_of(parser.parse([])) == {}
    assert task_of(parser.parse(["--start", "wide"])) == {"start": "wide"}


def test_options_that_a_command_lacks_are_not_read():
    parser = Parser()
    add_task_options(parser, ("--steps", "--trials"))
    assert task_of(parser.parse([])) == {"steps": STEPS, "trials": TRIALS}


# ------------------------------------------------------------------------------ settings


def cases_for(line, agents):
    parser = Parser()
    add_case_options(parser)
    return cases_of(parser.parse(shlex.split(line)), agents)


def test_settings_are_changed_for_the_agent_that_is_named():
    line = "--set q-learning.learning_rate=0.3 --set reinforce.epochs=3"
    q_learning, reinforce, guess = cases_for(line, ["q-learning", "reinforce", "random-search"])
    assert q_learning.settings == replace(AGENTS.default("q-learning"), learning_rate=0.3)
    assert reinforce.settings == replace(AGENTS.default("reinforce"), epochs=3)
    assert guess.settings == AGENTS.default("random-search")
    names = [case.settings_name for case in (q_learning, reinforce, guess)]
    assert names == ["default, learning_rate=0.3", "default, epochs=3", "default"]


def test_the_agent_may_be_left_out_where_there_is_one():
    for line in ("--set learning-rate=0.3", "--set q-learning.learning-rate=0.3"):
        (case,) = cases_for(f"--settings as-published {line}", ["q-learning"])
        assert case.settings_name == "as-published"
        assert case.settings.learning_rate == 0.3


def test_a_sweep_gives_a_case_for_each_combination():
    line = "--set q-learning.discount=0.9,0.99 --set q-learning.mirrored=True,False"
    cases = cases_for(line, ["q-learning", "random-search"])
    assert [case.settings_name for case in cases] == [
        "default, discount=0.9",
        "default, discount=0.9, mirrored=False",
        "default",
        "default, mirrored=False",
        "default",
    ]
    assert len({case.key for case in cases}) == 5


def test_a_settings_file_is_for_its_agent_and_can_be_changed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = "agent = 'q-learning'\n[settings]\nlearning_rate = 0.5\n"
    for name in ("a.toml", "b.toml"):
        (tmp_path / name).write_text(text.replace("0.5", "0.25") if name == "b.toml" else text)
    line = "--settings-file a.toml --settings as-published --set q-learning.discount=0.9,0.8"
    *cases, guess = cases_for(line, ["q-learning", "random-search"])
    assert [case.settings_name for case in cases] == [
        "a.toml, discount=0.9",
        "a.toml, discount=0.8",
    ]
    assert cases[1].settings == replace(
        AGENTS.default("q-learning"), learning_rate=0.5, discount=0.8
    )
    assert guess.settings == AGENTS.default("random-search")
    both = cases_for("--settings-file a.toml --settings-file b.toml", ["q-learning"])
    assert [case.settings.learning_rate for case in both] == [0.5, 0.25]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("--set learning_rate=0.3", "it must name one of the agents: AGENT.learning_rate=0.3"),
        ("--set ndp.hidden=3", "'ndp' is not among the agents: q-learning, random-search"),
        ("--set q_learning.discount=1", "did you mean 'q-learning'?"),
        ("--set q-learning.discont=1", "did you mean 'discount'?"),
        ("--set q-learning.discount=2", "discount is 2.0"),
        ("--set q-learning.discount=", "discount is ''"),
        ("--set q-learning.discount", "it must be NAME=VALUE"),
        ("--set q-learning.discount=1 --set q-learning.discount=0.5", "is given twice"),
        ("--settings-file reinforce.toml", "it is for reinforce, which is not among the agents"),
        ("--settings-file same.toml --settings-file x/same.toml", "there are two of this name"),
    ],
)
def test_settings_that_cannot_be_are_refused(line, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x").mkdir()
    for name in ("same.toml", "x/same.toml", "reinforce.toml"):
        agent = "reinforce" if "reinforce" in name else "q-learning"
        (tmp_path / name).write_text(f"agent = '{agent}'\n[settings]\n")
    with pytest.raises(UprightError, match=re.escape(said)):
        cases_for(line, ["q-learning", "random-search"])


def test_a_custom_agent_has_no_settings_to_change(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    agent = "examples.plain_agent:PlainAgent"
    with pytest.raises(UprightError, match="it has no settings that could be changed here"):
        cases_for(f"--set {agent}.agent_name=x", [agent])


def test_a_table_sweeps_settings_and_parameters(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    line = "table --agents random-search,q-learning --noises none,sensor-5 --runs 1 --steps 50"
    line += " --set random-search.x_scale=2,3 --parameter half_length=0.5,1.0 --store runs.sqlite"
    assert run([*line.split(), "--format", "json"]) == 0
    shown = capsys.readouterr()
    assert "12 cases of 1 run each" in shown.err
    rows = json.loads(shown.out)
    found = [(row["settings"], row["parameters"], row["noise"]) for row in rows]
    assert len(found) == len(set(map(str, found))) == 12
    assert found[2] == ("default, x_scale=2.0", {"half_length": 1.0}, "none")
    assert found[-1] == ("default", {"half_length": 1.0}, "sensor-5")
    again = line.replace("=0.5,1.0", "=0.5:1:2").replace("=2,3", "=2:3:2")
    assert run([*again.split(), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out) == rows
    assert run(["show", "runs.sqlite", "--format", "json"]) == 0
    kept = {(row["settings"], row["noise"]) for row in json.loads(capsys.readouterr().out)}
    assert kept == {(row["settings"], row["noise"]) for row in rows}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("table --parameter half_length=1,x", "half_length is 'x'; it must be a number"),
        ("table --parameter half_length=1,0", "half_length is 0.0"),
        ("table --parameter half_length=1 --parameter half-length=2", "is given twice"),
        ("table --parameter half_length=1:2", "half_length is '1:2'; a range is LOW:HIGH:COUNT"),
        ("table --parameter half_length=0:2:3", "half_length is 0.0"),
        ("table --parameter lenght=1:2:3", "parameter is 'lenght'"),
        ("learn reinforce --parameter half_length=1:2:3", "half_length is '1:2:3'; it must be a"),
        ("table --agents q-learning --set discount=0.5:1:1", "discount is '0.5:1:1'; COUNT must"),
        ("table --parameter force=" + ",".join(["1"] * 1001), "the sweep has 1,001 cases"),
        ("table --parameter force=" + ",".join(["1"] * 100), "the sweep has 4,200 cases"),
        ("learn reinforce --parameter half_length=1,2", "half_length is '1,2'"),
        ("learn q-learning --set discount=0.9,0.99", "ask for 2 cases; this command has one"),
    ],
)
def test_a_sweep_that_cannot_be_is_refused_before_anything_runs(line, said, capsys):
    assert run(line.split()) == BAD_USE
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


# ------------------------------------------------------------------------------ did you mean


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("lern reinforce", "learn"),
        ("ros2 simulte", "simulate"),
        ("learn reinforse", "reinforce"),
        ("learn Q_Learning", "q-learning"),
        ("learn reinforce --noise gausian-0.1", "gaussian-0.1"),
        ("learn reinforce --start rondom", "random"),
        ("learn reinforce --condition varied-plants", "varied-plant"),
        ("learn reinforce --plant-set integrator=semi_implicit", "semi-implicit"),
        ("learn reinforce --parameter half-lenght=1", "half_length"),
        ("learn reinforce --settings published", "as-published"),
        ("learn reinforce --set learning-rat=1", "learning_rate"),
        ("learn reinforce --plant mujco", "mujoco"),
        ("learn reinforce --plant mujoco --plant-set physics_steps=1", "physics_step"),
        ("table --agents reinforce,qlearning", "q-learning"),
        ("table --noises none,sensr-5", "sensor-5"),
        ("table --format markdwn", "markdown"),
        ("plot curvs runs.sqlite", "curves"),
        ("plot sweep runs.sqlite --parameter half-length", "half_length"),
        ("plants equation", "equations"),
        ("ros2 simulate --plant gazbo", "gazebo"),
        ("export policy.npz policy.onx", ".onnx"),
        ("completion bsh", "bash"),
        ("learn reinforce --niose none", "--noise"),
        ("matlab table --noizes none", "--noises"),
    ],
)
def test_an_unknown_name_is_answered_with_the_nearest(line, meant, capsys):
    try:
        status = run(line.split())
    except SystemExit as refusal:
        status = refusal.code
    error = capsys.readouterr().err
    assert status == BAD_USE
    assert error.count("\n") == 1
    assert f"; did you mean {meant!r}?" in error


@pytest.mark.parametrize("line", ["dance", "learn nobody", "learn reinforce --fast", "plants 7"])
def test_a_name_that_is_like_no_other_is_answered_with_no_guess(line, capsys):
    try:
        status = run(line.split())
    except SystemExit as refusal:
        status = refusal.code
    assert status == BAD_USE
    assert "did you mean" not in capsys.readouterr().err


@pytest.mark.parametrize("name", LEAVES)
def test_no_option_may_be_shortened(name, capsys):
    """Otherwise an option that a command lacks is taken for a longer one that it has."""
    needed = [action for action in LEAVES[name]._actions if not action.option_strings]
    words = [next(iter(a.choices)) if a.choices else "x" for a in needed if a.nargs != "?"]
    flags = [flag for flag in LEAVES[name]._option_string_actions if flag.startswith("--")]
    for flag in flags:
        if flag[:-1] not in flags and flag != "--ros-args":
            with pytest.raises(SystemExit) as refusal:
                make_parser([name.split()[0]]).parse([*name.split(), *words, flag[:-1]])
            assert refusal.value.code == BAD_USE
            error = capsys.readouterr().err
            assert f"unrecognized arguments: {flag[:-1]}; did you mean" in error
            assert error.endswith(f"(see upright {name} --help)\n")


def test_whole_numbers_are_read_as_people_write_them():
    line = "learn reinforce --steps 600,000 --trials 1e3 --seed 1_000 --run 2k"
    options = make_parser().parse(line.split())
    assert (options.steps, options.trials, options.seed, options.run) == (600000, 1000, 1000, 2000)


@pytest.mark.parametrize("name", LEAVES)
def test_every_whole_number_is_read_by_the_same_function(name):
    defaults = [action for action in LEAVES[name]._actions if type(action.default) is int]
    assert {action.type for action in defaults} <= {as_whole}
    assert int not in {action.type for action in LEAVES[name]._actions}


def test_a_list_in_one_option_is_refused_where_nodes_have_lists():
    options = make_parser().parse(["ros2", "simulate", "--parameter", "gravity=1,half_length=1"])
    with pytest.raises(UprightError, match="--parameter is 'gravity=1,half_length=1'; give"):
        given(options, SimulatorSettings)


def test_an_unknown_option_before_the_command_is_refused(capsys):
    with pytest.raises(SystemExit) as refusal:
        run(["--fast", "learn", "reinforce"])
    assert refusal.value.code == BAD_USE
    assert "unrecognized arguments: --fast" in capsys.readouterr().err


def test_the_examples_in_docstrings_of_errors_are_true():
    found = doctest.testmod(upright.errors, extraglobs={"upright": upright})
    assert found.attempted
    assert not found.failed


def test_every_argument_of_every_command_is_walked():
    walked = list(actions(make_parser()))
    assert len(walked) > sum(len(parser._actions) for parser in ALL.values())


@pytest.mark.parametrize(
    "line",
    [
        "X",
        "show X",
        "study X.toml",
        "table --agents X",
        "table --agents X:Y",
        "table --agents json:X",
        "table --noises X",
        "table --noises gaussian=X",
        "table --condition each-run.X=1:2",
        "table --start X",
        "table --runs X",
        "table --set X=1",
        "table --set q-learning.discount=X",
        "table --parameter X=1",
        "table --parameter force=X",
        "table --parameter force=X:1:2",
        "table --plant X",
        "table --plant-set integrator=X",
        "table --store X",
        "table --output X",
        "tune q-learning --search X",
        "tune q-learning --search discount=X",
        "learn q-learning --video X.mp4",
    ],
)
def test_a_long_value_is_named_without_its_middle(line, capsys):
    try:
        status = run(line.replace("X", "x" * 3000).split())
    except SystemExit as ended:
        status = ended.code
    assert status == BAD_USE
    error = capsys.readouterr().err
    assert "xxx...xxx" in error
    assert len(error) < 800
