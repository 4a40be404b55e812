"""The public names: `import upright` is quick, and each name has a docstring that is true."""

import ast
import doctest
import inspect
import itertools
import re
import shlex
import subprocess
import sys
import tomllib
from importlib import import_module

import pytest
from helpers import python

import upright
from upright.errors import missing
from upright.support.files import PACKAGE

NAMES = [name for name in dir(upright) if not name.startswith("_")]
FUNCTIONS = [name for name in NAMES if inspect.isfunction(getattr(upright, name))]


def docstring(name):
    """Return the docstring of a public name: of data, the text below its assignment."""
    value = getattr(upright, name)
    if inspect.isclass(value) or inspect.isroutine(value):
        return inspect.getdoc(value)
    module = import_module(upright._MODULE_OF[name])
    body = ast.parse(inspect.getsource(module)).body
    for statement, text in itertools.pairwise(body):
        targets = getattr(statement, "targets", [getattr(statement, "target", None)])
        if [getattr(target, "id", None) for target in targets] == [name]:
            is_text = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
            return inspect.cleandoc(text.value.value) if is_text else None
    return None


def imports_for_type_checkers():
    """Return the module of each name that type checkers and editors see."""
    places = {}
    for node in ast.walk(ast.parse((PACKAGE / "__init__.py").read_text())):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for line in node.body:
                assert [alias.name for alias in line.names] == [a.asname for a in line.names]
                places |= {alias.name: line.module for alias in line.names}
    return places


def failures(name, text, capsys):
    """Return what the examples of a docstring print that they should not."""
    test = doctest.DocTestParser().get_doctest(text, {"upright": upright}, name, name, 0)
    assert test.examples, f"{name} has no example"
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS)
    runner.run(test)
    return capsys.readouterr().out


def test_type_checkers_see_the_names_that_there_are():
    assert imports_for_type_checkers() == upright._MODULE_OF


def test_there_are_no_other_names():
    assert set(dir(upright)) == {"__version__", *upright._MODULE_OF}
    namespace = {}
    exec("from upright import *", namespace)
    assert namespace.keys() - {"__builtins__"} == set(dir(upright))


def test_an_unknown_name_is_refused():
    with pytest.raises(AttributeError, match="module 'upright' has no attribute 'Pendulum'"):
        upright.Pendulum  # noqa: B018
    with pytest.raises(ImportError, match="cannot import name 'Pendulum'"):
        exec("from upright import Pendulum")


@pytest.mark.parametrize("name", NAMES)
def test_every_name_has_a_docstring_whose_example_is_true(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = docstring(name)
    assert text, f"{name} has no docstring"
    assert "Examples\n--------" in text
    assert failures(name, text, capsys) == ""


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_explains_its_parameters(name):
    section = docstring(name).partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    heads = [line.strip("*") for line in section.splitlines() if not line.startswith(" ")]
    explained = ", ".join(heads).split(", ")
    assert explained == list(inspect.signature(getattr(upright, name)).parameters)


def test_the_page_of_the_package_is_true(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert failures("upright", upright.__doc__, capsys) == ""


def test_the_page_of_the_package_names_every_name():
    for name in NAMES:
        assert f"`{name}`" in upright.__doc__, name


def test_a_false_example_is_noticed(capsys):
    assert "Expected" in failures("false", ">>> upright.NOISES['none'].angle\n1.0\n", capsys)


@pytest.mark.parametrize(
    "name", ["numpy", "numba", "scipy", "gymnasium", "argparse", "upright.core"]
)
def test_importing_the_package_does_not_import(name):
    ended = python(f"import sys, upright; dir(upright); sys.exit({name!r} in sys.modules)")
    assert ended.returncode == 0, ended.stderr


def test_names_of_data_come_without_compiled_code():
    code = "import sys; from upright import NOISES, Parameters, State, AGENTS, UprightError"
    ended = python(f"{code}; sys.exit('numba' in sys.modules)")
    assert ended.returncode == 0, ended.stderr


WITHOUT_GYMNASIUM = """
import sys
from importlib.machinery import PathFinder

class Blind(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.startswith("gymnasium") else super().find_spec(name, path, target)

sys.meta_path[:] = [Blind if finder is PathFinder else finder for finder in sys.meta_path]
import upright
"""


def test_without_gymnasium_all_else_is_there():
    code = f"{WITHOUT_GYMNASIUM}\nfrom upright import *\nprint(sorted(dir(upright)))"
    ended = python(code)
    assert ended.returncode == 0, ended.stderr
    assert "'learn'" in ended.stdout
    assert "CartPoleEnv" not in ended.stdout


def test_without_gymnasium_its_names_say_how_to_get_it():
    ended = python(f"{WITHOUT_GYMNASIUM}\nfrom upright import CartPoleEnv")
    last = ended.stderr.splitlines()[-1]
    assert last.startswith("upright.errors.UprightError: CartPoleEnv needs Gymnasium: pip install")
    assert "'gymnasium>=1.1'" in last


def test_help_shows_the_page_and_every_name():
    ended = python("import upright; help(upright)")
    assert ended.returncode == 0, ended.stderr
    assert upright.__doc__.splitlines()[0] in ended.stdout
    for name in NAMES:
        assert name in ended.stdout


def test_the_module_runs_as_a_command():
    ended = subprocess.run(
        [sys.executable, "-m", "upright", "--version"], capture_output=True, text=True, check=True
    )
    assert ended.stdout == f"upright {upright.__version__}\n"


# ------------------------------------------------------------------------- what the names do


def test_learn_makes_the_run_of_a_study_and_returns_its_policy():
    task = {"noise": "gaussian-0.1", "steps": 500}
    policy, result = upright.learn("q-learning", seed=4, run=2, **task)
    case = upright.make_case("q-learning", **task)
    studied = upright.study([case], runs=3, seed=4)[case][2]
    assert result.run == studied.run == 2
    assert result.lengths.tolist() == studied.lengths.tolist()
    assert (policy.agent, policy.settings) == ("q-learning", case.settings)
    assert {**policy.task, "trials": 0}.items() >= {**task, "seed": 4, "run": 2}.items()


def test_learn_takes_the_settings_by_name():
    policy, _ = upright.learn("q-learning", "as-published", steps=50, trials=2)
    assert policy.settings == upright.make_case("q-learning", "as-published").settings
    assert policy.settings != upright.make_case("q-learning").settings


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"agent": "nobody"}, "agent is 'nobody'"),
        ({"settings": "best"}, "settings is 'best'"),
        ({"seed": -1}, "seed is -1"),
        ({"run": 0.5}, "run is 0.5"),
        ({"noise": "loud"}, "noise is 'loud'"),
        ({"plant": "sand"}, "plant is 'sand'"),
        ({"agent": "helpers:Nobody"}, "agent is 'helpers:Nobody'"),
        ({"agent": 3}, "agent is 3; it must be a name, or a class or function"),
    ],
)
def test_learn_refuses_in_one_line(arguments, told):
    with pytest.raises(upright.UprightError, match=f"^{re.escape(told)}[^\n]*$"):
        upright.learn(**{"agent": "random-search", "steps": 50} | arguments)


def test_play_is_on_the_task_that_was_learned_but_for_the_changes():
    policy, _ = upright.learn("adaptive-lqr", noise="sensor-5", steps=700)
    same, other = upright.play(policy, 4), upright.play(policy, 4, steps=90, noise="none")
    assert {trial.steps for trial in same} == {700}
    assert {trial.steps for trial in other} == {90}
    assert all(trial.balanced for trial in same + other)


def test_play_draws_its_trials_from_its_seed():
    policy, _ = upright.learn("random-search", steps=50, trials=1)
    first, again, other = (upright.play(policy, 8, seed, steps=5000) for seed in (1, 1, 2))
    assert first == again != other


@pytest.mark.parametrize("changes", [{"episodes": 0}, {"seed": -1}, {"noise": "loud"}])
def test_play_refuses_in_one_line(changes):
    policy, _ = upright.learn("random-search", steps=50, trials=1)
    ((name, value),) = changes.items()
    with pytest.raises(upright.UprightError, match=f"^{name} is {value!r}; "):
        upright.play(policy, **changes)


def test_play_films(tmp_path):
    policy, _ = upright.learn("adaptive-lqr", steps=60)
    played = upright.play(policy, 2, video=tmp_path / "film.gif")
    assert played == upright.play(policy, 2)
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF")


def test_a_plant_goes_by_its_name():
    pytest.importorskip("mujoco")
    policy, result = upright.learn("adaptive-lqr", plant="mujoco", steps=300)
    assert result.success
    assert policy.plant["name"] == "mujoco"


def test_a_study_without_a_store_returns_what_one_with_a_store_does(tmp_path):
    case = upright.make_case("random-search", steps=200)
    with upright.Store(tmp_path / "runs.sqlite") as store:
        upright.study([case], runs=2, store=store)
        kept = upright.study([case], runs=4, store=store)
    made = upright.study(iter([case]), runs=4)
    assert [r.lengths.tolist() for r in kept[case]] == [r.lengths.tolist() for r in made[case]]
    assert [r.run for r in made[case]] == [0, 1, 2, 3]


def test_a_policy_without_settings_is_not_saved(tmp_path):
    policy, _ = upright.learn("random-search", steps=50, trials=1)
    upright.export_policy(tmp_path / "policy.json", policy)
    read = upright.load_policy(tmp_path / "policy.json")
    with pytest.raises(upright.UprightError, match="without its settings"):
        upright.save_policy(tmp_path / "policy.npz", read)


def test_a_policy_that_was_loaded_can_be_saved_again(tmp_path):
    policy, _ = upright.learn("q-learning", "as-published", steps=50, trials=3)
    first, second = tmp_path / "first.npz", tmp_path / "second.npz"
    upright.save_policy(first, policy)
    upright.save_policy(second, upright.load_policy(first))
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize(
    "extra", ["data", "video", "gymnasium", "mujoco", "notebook", "onnx", "record", "ros2", "tune"]
)
def test_every_extra_has_a_command_that_names_its_libraries(extra):
    project = tomllib.loads((PACKAGE.parents[1] / "pyproject.toml").read_text())["project"]
    wanted = [line.partition(";")[0] for line in project["optional-dependencies"][extra]]
    told = str(missing("this", extra))
    command, _, rest = told.removeprefix("this: pip install ").partition(" (")
    assert shlex.split(command) == wanted
    assert rest == f"the extra {extra!r} of upright)"
