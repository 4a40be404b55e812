import re
import tomllib
from pathlib import Path

import pytest
from helpers import ROOT
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import upright
from upright.agents import AGENTS
from upright.commands import make_parser, parse, table
from upright.commands.study import FILE
from upright.core.conditions import CONDITIONS, NOISES, PUBLISHED_NOISES, STARTS
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.plants.mujoco import Mujoco
from upright.studies.case import make_case
from upright.studies.settings_file import settings_text
from upright.studies.study_file import KEYS, read_study, save_study
from upright.studies.task_file import PARTS
from upright.support.toml_file import toml_text

ANY = "agents = ['random-search']\n"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with a file of tuned settings, and one of a task."""
    monkeypatch.chdir(tmp_path)
    tuned = make_case("q-learning", settings={"discount": 0.9}).settings
    Path("tuned.toml").write_text(settings_text("q-learning", tuned, {}))
    Path("my-cart.toml").write_text("noise = 'sensor-5'\nsteps = 50\n[parameters]\nforce = 12.0\n")
    return tmp_path


def read(text, path="a.toml"):
    Path(path).parent.mkdir(exist_ok=True)
    Path(path).write_text(text)
    return read_study(path)


def keys(plan):
    return [case.key for case in plan["cases"]]


def asked_for(line, monkeypatch):
    """Return the cases that `upright table` would run, and its options."""
    measured = []
    monkeypatch.setattr(table, "measure", lambda *given, **_: measured.append(given) or 0)
    words = ["table", *([] if "--agents" in line else ["--agents", "random-search"]), *line.split()]
    options = parse(make_parser(["table"]), words)
    assert table.run(options) == 0
    ((cases, options),) = measured
    return list(dict.fromkeys(cases)), options


SAME = {
    "all as usual": ("noise = 'all'", "--agents random-search"),
    "several noises": (
        "noise = ['none', 'all=0.1']",
        "--agents random-search --noises none,all=0.1",
    ),
    "a grid": (
        "steps = 300\n[parameters]\nhalf_length = '0.25:1:4'\nforce = [9, 10.0, '11:12:2:log']",
        "--agents random-search --noises none --steps 300 --parameter half_length=0.25:1:4 "
        "--parameter force=9,10,11:12:2:log",
    ),
    "a part of the task": (
        "start = 'wide'\ncondition = 'delay=1,encoder=100'\ntrials = 7",
        "--agents random-search --noises none --start wide --condition encoder=100,delay-1 "
        "--trials 7",
    ),
    "settings": (
        "agents = ['q-learning', 'ndp']\n[settings.q-learning]\ndiscount = ['0.9:0.99:3', 1]\n"
        "x_edges = [[-1, 1], [-2.0, 2.0]]\n[settings.ndp]\ndiscount = 0.9",
        "--agents q-learning,ndp --noises none --set q-learning.discount=0.9:0.99:3,1 "
        "--set ndp.discount=0.9 --set q-learning.x_edges=(-1,1),(-2.0,2.0)",
    ),
    "settings as published": (
        "agents = ['q-learning', 'random-search']\nsettings.q-learning.from = 'as-published'",
        "--agents q-learning,random-search --noises none --settings as-published",
    ),
    "settings of a file": (
        "agents = ['q-learning', 'random-search']\n[settings.q-learning]\nfrom = 'tuned.toml'\n"
        "theta_edges = [-0.1, 0.1]\ndiscount = [0.9, 0.8]",
        "--agents q-learning,random-search --noises none --settings-file tuned.toml "
        "--set q-learning.theta_edges=(-0.1,0.1) --set q-learning.discount=0.9,0.8",
    ),
    "a task file": (
        "tasks = ['my-cart.toml']\nparameters.half_length = [0.3, 0.4]",
        "--agents random-search --task my-cart.toml --parameter half_length=0.3,0.4",
    ),
    "a plant": (
        "[plant]\nname = 'mujoco'\nphysics_step = 0.01",
        "--agents random-search --noises none --plant mujoco --plant-set physics_step=0.01",
    ),
    "the file of the help": (
        FILE,
        "--agents q-learning,random-search --noises none,gaussian-0.2 --steps 6000 "
        "--parameter half_length=0.25:1:4 --plant-set integrator=rk4 "
        "--set q-learning.discount=0.9,0.99",
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_a_file_has_the_cases_of_the_command_in_its_order(name, monkeypatch):
    text, line = SAME[name]
    cases, _ = asked_for(line, monkeypatch)
    assert keys(read(text if "agents = " in text else ANY + text)) == [case.key for case in cases]


@pytest.mark.parametrize("name", SAME)
def test_what_a_command_asks_for_can_be_saved_as_a_file(name, monkeypatch, capsys):
    Path("within").mkdir()
    line = f"{SAME[name][1]} --runs 3 --seed 4 --store all.sqlite --save-study within/saved.toml"
    cases, _ = asked_for(line, monkeypatch)
    assert capsys.readouterr().err == "study: within/saved.toml\n"
    plan = read_study("within/saved.toml")
    assert keys(plan) == [case.key for case in cases]
    assert (plan["runs"], plan["seed"]) == (3, 4)
    assert Path(plan["store"]).resolve() == Path("all.sqlite").resolve()


def test_without_a_store_a_saved_file_has_its_own(monkeypatch):
    asked_for("--agents random-search --noises none --save-study saved.toml", monkeypatch)
    assert read_study("saved.toml")["store"] == "saved.sqlite"


def test_what_is_left_out_is_as_the_page_says():
    plan = read(ANY)
    assert plan == {
        "cases": [make_case("random-search")],
        "runs": 20,
        "seed": 0,
        "store": "a.sqlite",
    }


def test_tasks_that_are_no_grid_add_to_what_stands_above():
    plan = read(
        "agents = ['random-search', 'ndp']\nsteps = [50, 60]\nparameters.force = 9\n"
        "tasks = ['my-cart.toml', {noise = ['none', 'all-5'], parameters = {gravity = 9}}, {}]"
    )
    tasks = [case.spec for case in plan["cases"]]
    assert tasks[: len(tasks) // 2] == tasks[len(tasks) // 2 :]
    changes = [(t.noise, t.steps, t.parameters.force, t.parameters.gravity) for t in tasks[:7]]
    assert changes == [
        ("sensor-5", 50, 12.0, 9.8),
        ("none", 50, 9.0, 9.0),
        ("all-5", 50, 9.0, 9.0),
        ("none", 60, 9.0, 9.0),
        ("all-5", 60, 9.0, 9.0),
        ("none", 50, 9.0, 9.8),
        ("none", 60, 9.0, 9.8),
    ]


def test_there_may_be_several_plants_whose_settings_have_several_values():
    plan = read(
        f"{ANY}noise = ['none', 'all-5']\n[[plant]]\nname = ['equations', 'gazebo']\n"
        "[[plant]]\nname = 'mujoco'\nintegrator = ['rk4', 'euler']"
    )
    plants = [case.plant for case in plan["cases"]][::2]
    usual = [PLANTS.default("equations"), PLANTS.default("gazebo")]
    assert plants == [*usual, Mujoco(integrator="rk4"), Mujoco(integrator="euler")]


def test_several_sources_of_settings_are_told_apart():
    plan = read("agents = 'q-learning'\nsettings.q-learning.from = ['default', 'tuned.toml']")
    assert [case.settings_name for case in plan["cases"]] == ["default", "tuned.toml"]


def test_paths_are_relative_to_the_file(folder):
    model = (ROOT / "tests/data/models/sideways.urdf").read_text()
    Path("within").mkdir()
    Path("within/cart.urdf").write_text(model)
    Path("within/task.toml").write_text("[plant]\nname = 'mujoco'\nmodel = 'cart.urdf'")
    Path("tuned.toml").rename("within/tuned.toml")
    text = "agents = ['q-learning']\nsettings.q-learning.from = 'tuned.toml'\nstore = 'x/runs'\n"
    for last in ("tasks = ['task.toml']", "plant = {name = 'mujoco', model = 'cart.urdf'}"):
        plan = read(text + last, "within/a.toml")
        assert plan["store"] == str(Path("within/x/runs"))
        (case,) = plan["cases"]
        assert case.plant.model == str(Path("within/cart.urdf"))
        assert case.plant == upright.read_task("within/task.toml")["plant"]
    upright.save_task(folder / "saved.toml", case)
    again = upright.read_task(folder / "saved.toml")["plant"].model
    assert Path(again).resolve() == Path("within/cart.urdf").resolve()


def test_the_example_and_the_files_of_the_documents_are_read():
    assert len(read_study(ROOT / "examples/study.toml")["cases"]) == 36
    (text,) = re.findall(
        "```toml\n# lengths.toml\n(.*?)```", (ROOT / "docs/studies.md").read_text(), re.DOTALL
    )
    assert text == FILE
    assert len(read(text)["cases"]) == 24


def test_the_page_lists_every_key():
    page = (ROOT / "docs/studies.md").read_text()
    lines = ["| key | meaning |", "|---|---|", *(f"| `{k}` | {text} |" for k, text in KEYS.items())]
    assert "\n" + "\n".join(lines) + "\n\n" in page
    assert {*PARTS} < {*KEYS}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("runs = 3", "it must have the key agents"),
        ("agents = []", "line 1, agents: agents is []; it must be a name, or a list of names"),
        ("agents = ['ndp', 'ase-ace', 'ndp']", "line 1, agents: agents is ['ndp', 'ase-ace', 'ndp"),
        ("agents = ['q-lerning']", "line 1, agents: agent is 'q-lerning'"),
        ("agents = ['no_such:A']", "line 1, agents: agent is 'no_such:A'; there is no module"),
        ("runs = 0", "line 2, runs: runs is 0; it must be a whole number, at least 1"),
        ("seed = 'x'", "line 2, seed: seed is 'x'; it must be a whole number"),
        ("store = ''", "line 2, store: store is ''; it must be the path of a file"),
        ("store = 'a.toml'", "line 2, store: store is 'a.toml'; it is the same file as study file"),
        (f"store = '{'x' * 999}'", f"line 2, store: store is '{'x' * 47}...{'x' * 48}'; it cannot"),
        ("stores = 'x'", "line 2, stores: key is 'stores'; it must be one of agents, runs"),
        ("noise = 'gausian-0.1'", "line 2, noise: noise is 'gausian-0.1'"),
        (
            "noise = ['none', 'delay=1']",
            "line 2, noise: noise is 'delay=1'; it belongs to the cond",
        ),
        ("noise = ['none', 3]", "line 2, noise: noise is 3; it must be a text, or a table of"),
        ("noise = []", "line 2, noise: noise is []; it must have a value"),
        (
            "[noise]\nactuator = [0.1]",
            "line 3, noise.actuator: actuator is [0.1]; it must be a num",
        ),
        ("noise = ['none', 'none']", "line 2, noise: noise is ['none', 'none']; it has 'none' twi"),
        ("steps = [1, 2, 1]", "line 2, steps: steps is [1, 2, 1]; it has 1 twice"),
        ("steps = [1, 0]", "line 2, steps: steps is 0; it must be a whole number"),
        (
            "steps = '300'",
            "line 2, steps: steps is '300'; it must be a number, several in a list,",
        ),
        ("steps = '1:2'", "line 2, steps: steps is '1:2'; a range is LOW:HIGH:COUNT"),
        ("parameters = 3", "line 2, parameters: parameters is 3; it must be a table, [parameters]"),
        ("[parameters]\nforc = 1", "line 3, parameters.forc: parameter is 'forc'"),
        (
            "[parameters]\nforce = [1, -1]",
            "line 3, parameters.force: force is -1; it must be a num",
        ),
        (
            "[parameters]\nforce = '0:1:1000'\nhalf_length = [1, 2]",
            "line 3, parameters.force: the sweep has 2,0",
        ),
        ("half_length = 3", "line 2, half_length: half_length is a parameter of the plant; it be"),
        ("discount = 3", "line 2, discount: discount is a setting of the agent reinforce; it belo"),
        ("[parameters]\ndiscount = 3", "line 3, parameters.discount: parameter is 'discount'"),
        ("plant = 'mujoco'", "line 2, plant: plant is 'mujoco'; it must be a table, [plant]"),
        ("[[plant]]\n[[plant]]\nname = 'x'", "line 4, plant[1].name: plant is 'x'; it must be one"),
        ("[plant]\nintegrator = ['rk4', 'rk5']", "line 3, plant.integrator: integrator is 'rk5'"),
        ("settings = 3", "line 2, settings: settings is 3; it must have a table for each agent"),
        ("[settings.ndp]", "line 2, settings.ndp: agent is 'ndp'; it must be one of random-search"),
        ("settings.random-search = 3", "line 2, settings.random-search: random-search is 3; it mu"),
        (
            "[settings.random-search]\nspeed = 3",
            "line 3, settings.random-search.speed: setting is 'speed'; it must be one of",
        ),
        (
            "[settings.random-search]\nfrom = 'x'",
            "line 3, settings.random-search.from: from is 'x'; it must be one of default",
        ),
        (
            "[settings.random-search]\nfrom = ['default', 'default']",
            "line 3, settings.random-search.from: from is ['default', 'default']; it has 'default'",
        ),
        (
            "[settings.random-search]\nfrom = 'tuned.toml'",
            "line 3, settings.random-search.from: agent of the settings file is 'q-learning'",
        ),
        ("tasks = 3", "line 2, tasks: tasks is 3; it must be tables, [[tasks]], or a list of"),
        ("tasks = [3]", "line 2, tasks[0]: task is 3; it must be a table, or the name of a task"),
        ("tasks = ['x.toml']", "line 2, tasks[0]: task file is 'x.toml'; no such file"),
        ("[[tasks]]\n[[tasks]]\nruns = 3", "line 4, tasks[1].runs: key is 'runs'"),
        ("[[tasks]]\n[[tasks]]\nsteps = 0", "line 4, tasks[1].steps: steps is 0"),
        (
            "condition = 'each-run.force=1:2'\n[[tasks]]\nparameters.force = 3",
            "line 3, tasks[0]: force is 3.0, and the condition has each-run.force, which sets it",
        ),
    ],
    ids=lambda value: value[:30],
)
def test_a_wrong_file_is_refused_with_the_line_and_the_key(text, said):
    with pytest.raises(UprightError, match=re.escape(f"study file is 'a.toml'; {said}")) as error:
        read(text if said.startswith(("it must have", "line 1")) else ANY + text)
    assert "\n" not in str(error.value)


def test_settings_of_a_custom_agent_are_refused():
    Path("mine.py").write_text((ROOT / "src/upright/agents/starters/my_agent.py").read_text())
    with pytest.raises(UprightError, match="it has no settings that could be changed here"):
        read("agents = ['mine:A']\n[settings.'mine:A']\nspeed = 3")


def test_a_custom_agent_that_fails_is_reported_as_its_own(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    Path("failing_study_agent.py").write_text("class A:\n    def __init__(self, rng): 1 / 0\n")
    with pytest.raises(upright.AgentError, match="ZeroDivisionError"):
        read("agents = ['failing_study_agent:A']")


# ----------------------------------------------------------------------------------- any content


LEAVES = st.one_of(
    st.booleans(),
    st.integers(-(10**20), 10**20),
    st.floats(),
    st.dates(),
    st.sampled_from([*AGENTS, *NOISES, *CONDITIONS, *STARTS, *PLANTS.built_in, "as-published"]),
    st.sampled_from(["0.25:1:4", "1:2:1000", "tuned.toml", "delay=1", "\0", "x.toml"]),
    st.text(max_size=8).filter(lambda text: ":" not in text),
)
NAMES = st.sampled_from(
    ["half_length", "static_friction", "discount", "x_edges", "name", "integrator", "from", *KEYS]
) | st.sampled_from([*AGENTS, "engine", "model", "gaussian", "at-5.force", "", "x y"])
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=8,
)
CONTENTS = st.fixed_dictionaries(
    {"agents": st.just(["random-search", "q-learning"]) | VALUES},
    optional=dict.fromkeys(KEYS.keys() - {"agents"}, VALUES) | {"half_length": VALUES},
)


def inline(value):
    """Return any value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(key)} = {inline(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return toml(value)


def toml(value):
    if isinstance(value, (bool, int, float, str)):
        return toml_text({"x": value}).removeprefix("x = ").rstrip("\n")
    return value.isoformat()


def read_or_refused(text):
    """Return the study of any text, or None if it is refused, which must take a line."""
    Path("any.toml").write_text(text, newline="")
    try:
        return read_study("any.toml")
    except UprightError as error:
        message = str(error)
    assert "\n" not in message
    return None


ANYTHING = settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@ANYTHING
@given(content=CONTENTS)
def test_any_content_is_read_or_refused_in_a_line(content):
    lines = (f"{toml(key)} = {inline(value)}\n" for key, value in content.items())
    if plan := read_or_refused("".join(lines)):
        assert 1 <= len(plan["cases"]) <= 1000


@ANYTHING
@given(text=st.text() | st.binary(max_size=200).map(lambda data: data.decode("latin-1")))
def test_any_text_is_read_or_refused_in_a_line(text):
    read_or_refused(ANY + text)


def several(values, most=3):
    return st.lists(values, min_size=1, max_size=most)


GRIDS = st.fixed_dictionaries(
    {
        "noise": several(st.sampled_from([*PUBLISHED_NOISES, "actuator=0.1,gaussian=0.5"])),
        "steps": several(st.integers(1, 10**9)),
        "start": several(st.sampled_from(list(STARTS))),
        "condition": several(st.sampled_from([*CONDITIONS, "delay=1,encoder=1024"])),
        "parameters": st.fixed_dictionaries(
            {},
            optional={
                "half_length": several(st.floats(0.01, 9)),
                "gravity": several(st.floats(0, 9)),
            },
        ),
    }
)
PLANS = st.fixed_dictionaries({"runs": st.integers(1, 10**6), "seed": st.integers(0, 2**63 - 1)})


def unique(values):
    return list(dict.fromkeys(values))


@settings(ANYTHING, max_examples=25)
@given(
    plan=PLANS,
    grid=GRIDS,
    plant=st.sampled_from([PLANTS.default(name) for name in PLANTS.built_in])
    | st.builds(Mujoco, st.sampled_from([0.001, 0.02])),
    discounts=several(st.floats(0, 1)),
)
def test_a_study_is_read_back_as_it_was_written(plan, grid, plant, discounts):
    path = Path("saved.toml")
    changed = {"q-learning": {"from": ["default"], "discount": discounts}}
    save_study(path, {"agents": ["q-learning", "ndp"], **plan}, grid, plant, changed)
    again = read_study(path)
    assert {name: again[name] for name in plan} == plan
    (first, *_) = again["cases"]
    assert first.plant == plant
    # Read from the bare content, with every list as it was given, but for what it repeats.
    changed["q-learning"]["discount"] = unique(discounts)
    given = {name: unique(values) for name, values in grid.items() if name != "parameters"}
    given["parameters"] = {name: unique(each) for name, each in grid["parameters"].items()}
    bare = {"agents": ["q-learning", "ndp"], **plan, **given, "settings": changed}
    bare["plant"] = tomllib.loads(path.read_text()).get("plant", {})
    path.write_text(toml_text(bare))
    assert keys(read_study(path)) == keys(again)
