"""What tools/fuzz.py gives damaged inputs to: everything of Upright that parses.

A target has valid inputs, and a function that reads an input from a file as a command would, and
uses what it accepted. It may raise UprightError and nothing else.
"""

import argparse
import contextlib
import io
import json
import shlex
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fuzz_inputs import packed, unpacked

from upright.agents import AGENTS
from upright.commands import COMMANDS, make_parser, options, parse
from upright.core.conditions import CONDITION_TERMS, NOISE_TERMS
from upright.core.parameters import Parameters, State, parse_parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.policies.files import FORMATS, load_policy, read_header
from upright.policies.policy import Policy, form_of
from upright.studies.case import make_case
from upright.studies.playing import case_for
from upright.support.settings import values_of

ROOT = Path(__file__).parents[1]
OBSERVATIONS = (State(0.0, 0.0, 0.0, 0.0), State(0.1, -0.2, 0.05, 0.3), State(-2.0, 5.0, -0.2, 9.0))
"""Measurements that a policy is asked about."""


class Target(NamedTuple):
    """Something that reads what may come from anyone."""

    seeds: Callable[[], list[bytes]]
    """Returns valid inputs."""
    read: Callable[[Path], object]
    """Reads a file with an input, and uses what is in it."""
    suffix: str = ".txt"
    """How the name of the file ends."""
    words: Callable[[], list[bytes]] = list
    """Returns words of the language, to be put into inputs."""
    share: int = 10
    """How many of the inputs it gets, beside the shares of the others."""


def _texts(*texts: str) -> Callable[[], list[bytes]]:
    return lambda: [text.encode() for text in texts]


# ---- Policies ------------------------------------------------------------------------------------

PLAIN_AGENT = '''
from collections import deque
from dataclasses import dataclass
import numpy as np

@dataclass
class Step:
    seen: tuple
    right: bool

class Climber:
    """An agent in plain Python, which keeps some of everything."""

    def __init__(self, rng):
        self.rng, self.weights, self.best = rng, np.zeros(4), (0, None)
        self.visits, self.names, self.last = {(1, 2): 3.5}, {"a", "b"}, deque(maxlen=3)
        self.numbers = [np.float32(0.5), 2**70, float("nan"), 1 + 2j, b"x", range(3), None]

    def begin_trial(self, rng):
        self.last.clear()

    def act(self, observation, rng):
        self.last.append(Step(tuple(observation), True))
        return bool(self.weights @ np.array(observation) > 0)

    def learn(self, before, action, after, fallen):
        pass

    def end_trial(self, fallen):
        pass
'''


def _policies(agents: list[str], ending: str) -> list[bytes]:
    """Return files of policies of agents, and of a greedy one, that have learned nothing."""
    encoded = []
    for number, agent in enumerate(agents):
        task: dict[str, Any] = {"noise": "gaussian-0.1", "condition": "delay-1"}
        case = make_case(agent, **task) if number == 1 else make_case(agent)
        policy = Policy(
            agent,
            case.settings.agent(np.random.default_rng(number)),
            case.spec,
            settings=case.settings,
            greedy=number == 2,
        )
        data = FORMATS.module(ending).encode(policy)
        encoded.append(packed(unpacked(data)) if ending == ".npz" else data.encode())
    return encoded


def _archives() -> list[bytes]:
    released = sorted((ROOT / "tests/data/0.1.0").glob("*.npz"))
    small = [path.read_bytes() for path in released if path.stem not in ("reinforce", "ndp")]
    return [*_policies([name for name in AGENTS.built_in if name != "reinforce"], ".npz"), *small]


def _forms() -> list[bytes]:
    released = sorted((ROOT / "tests/data/0.1.0").glob("*.json"))
    files = [path.read_bytes() for path in released if path.stem != "expected"]
    return [*_policies(list(AGENTS.built_in), ".json"), *files]


def _plain_archives() -> list[bytes]:
    Path("fuzz_climber.py").write_text(PLAIN_AGENT)
    sys.path[:0] = [] if "" in sys.path else [""]
    return _policies(["fuzz_climber:Climber"], ".npz")


def _play(policy: Policy) -> None:
    rng = np.random.default_rng(0)
    for observation in OBSERVATIONS:
        probability = policy.push_probability(observation)
        if not 0.0 <= probability <= 1.0:
            raise AssertionError(f"the probability of a push is {probability}")
        policy.act(observation, rng)
        policy.learn(observation, True, observation, False)
    policy.begin_trial(rng)
    case_for(policy)


def _read_policy(path: Path) -> None:
    read_header(path)
    policy = load_policy(path)
    _play(policy)
    form_of(policy)
    for ending in (".json", ".h", *([".npz"] if policy.settings else [])):
        FORMATS.module(ending).encode(policy)


def _read_plain_policy(path: Path) -> None:
    policy = load_policy(path, "fuzz_climber:Climber")
    _play(policy)
    FORMATS.module(".npz").encode(policy)


# ---- Files of tasks and settings -----------------------------------------------------------------


def _task_files() -> list[bytes]:
    from upright.studies.task_file import task_text

    cases = [
        make_case("random-search"),
        make_case("random-search", noise="gaussian=0.1,actuator=5%", condition="delay=2,wind=1"),
        make_case("random-search", plant=PLANTS.default("mujoco"), parameters={"half_length": 0.3}),
    ]
    own = (
        b'noise = "none"\n[condition]\ndelay = 1\nno-velocities = true\n[plant]\nname="equations"\n'
    )
    return [*(task_text(case.spec, case.plant).encode() for case in cases), own]


def _read_task_file(path: Path) -> None:
    from upright.studies.task_file import read_task

    make_case("random-search", **read_task(path)).spec.task(np.random.default_rng(0))


def _study_files() -> list[bytes]:
    small = b'agents = ["random-search"]\nruns = 3\nseed = 1\nsteps = [300, 600]\n'
    grid = b'[parameters]\nhalf_length = "0.3:1:3"\n[settings.random-search]\nfrom = "default"\n'
    return [small + grid, (ROOT / "examples/study.toml").read_bytes()]


def _read_study_file(path: Path) -> None:
    from upright.studies.study_file import read_study

    for case in read_study(path)["cases"][:5]:
        case.spec.task(np.random.default_rng(0))


def _stores() -> list[bytes]:
    from upright.studies.store import Store
    from upright.studies.study import study

    old = [path.read_bytes() for path in sorted((ROOT / "tests/data/stores").glob("*.sqlite"))]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "runs.sqlite")
        with Store(path) as store:
            study([make_case("random-search", steps=300)], 5, store=store, executor="threads")
        return [*old, path.read_bytes()]


def _read_store(path: Path) -> None:
    from upright.reports.statistics import stored_rows
    from upright.studies.store import Store

    with Store(path, must_exist=True) as store:
        list(store.runs())
    stored_rows(path)


def _settings_files() -> list[bytes]:
    from upright.studies.settings_file import settings_text

    return [
        settings_text(name, settings, {"best": 1.5}).encode()
        for name in AGENTS.built_in
        for settings in AGENTS.settings(name).values()
    ]


def _read_settings_file(path: Path) -> None:
    from upright.studies.settings_file import read_settings

    file = read_settings(path)
    make_case(file.agent, settings=file.values)


def _settings_words() -> list[bytes]:
    names = {n for agent in AGENTS.built_in for n in values_of(AGENTS.default(agent))}
    return [f"{name} = ".encode() for name in sorted(names)]


# ---- Texts of options ----------------------------------------------------------------------------


def _terms() -> list[bytes]:
    return [
        *(b"none\nnominal", b"gaussian-0.1\ndelay-1", b"actuator=5%,gaussian=0.5\nwind=1:2"),
        b"all-5\ndelay=3,encoder=1024,gust=4,gust-every=0.2,gust-for=0.1,no-velocities",
        b"sensor=1e-3+others=0.1\nat-20.half_length=0.8+each-run.force=8:12,measurement-delay=2",
        b"none\ntilt=2,stick-slip=12,lag=0.03,dead-zone=1.5,saturation=8,dropped=0.1,varied-plant",
    ]


def _read_terms(path: Path) -> None:
    noise, _, condition = _text(path).partition("\n")
    spec = TaskSpec(noise, condition=condition)
    if TaskSpec.from_data(json.loads(json.dumps(spec.as_data()))) != spec:
        raise AssertionError(f"{spec} is another one once it was read again")
    spec.task(np.random.default_rng(0))


def _term_words() -> list[bytes]:
    terms = [*NOISE_TERMS, *CONDITION_TERMS]
    return [*(f",{name}=".encode() for name in terms), b":log", b"%", b"each-episode.", b"at-1."]


def _read_parameters(path: Path) -> None:
    texts = _text(path).split("\n")
    TaskSpec(parameters=Parameters()._replace(**parse_parameters(texts)))


def _command_lines() -> list[bytes]:
    """Return the examples of every command, an argument on each line."""
    lines = []
    for command in _modules(COMMANDS):
        for line in command.EXAMPLES.splitlines():
            words = line.strip().partition("   ")[0]
            if words.startswith("upright "):
                lines.append("\n".join(shlex.split(words)[1:]).encode())
    return lines


def _modules(commands: Any) -> Iterator[Any]:
    for name in commands:
        module = commands.module(name)
        yield module
        yield from _modules(getattr(module, "SUBCOMMANDS", ()))


def _option_words() -> list[bytes]:
    import_module("mujoco")

    flags = [*options.TASK, *options.SHARED, *options.PICTURES]
    values = ["half_length=0.1:2:3", "q-learning.discount=0.5", "time_step=1e-12", "x_edges=(1,2)"]
    return [f"\n{word}\n".encode() for word in (*flags, *values, *COMMANDS, *AGENTS, *PLANTS)]


def _read_command_line(path: Path) -> None:
    """Parse a command line, and make what its options ask for, short of doing it."""
    arguments = _text(path).split("\n")
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            listed = arguments[:1] if arguments[0] in COMMANDS else None
            given = parse(make_parser(listed, listed_only=listed is None), arguments)
    except SystemExit as ended:
        if ended.code == 0:
            return
        raise UprightError(said.getvalue().strip()) from None
    _make_what_is_asked_for(given)


def _make_what_is_asked_for(given: argparse.Namespace) -> None:
    names = vars(given)
    if names.get("size") is not None and "video" in names:
        options.size_of(given)
    if "parameters" not in names or "noise" not in names:
        return
    task = options.task_of(given)
    plant = {"plant": options.plant_of(given)} if "plant_changes" in names else {}
    agents = options.agents_of(given)
    if "changes" in names and agents:
        for case in options.cases_of(given, agents, **task, **plant):
            case.spec.task(np.random.default_rng(0))


# ---- Code of the user's own ----------------------------------------------------------------------


def _read_code(path: Path) -> None:
    """Look at a file as `upright check` does before it imports it; it is never run here."""
    from upright.agents.checks.names import advice, agents_in
    from upright.commands.check import agent_named, classes_in
    from upright.plants.custom import plants_in

    agents_in(path), plants_in(path), classes_in(path), advice(str(path))
    agent_named(str(path))


def _read_names(path: Path) -> None:
    """Look for an agent and a plant of this name; no module has one of these."""
    name = _text(path)
    if not name.partition(":")[0] or "upright" in name or "numpy" in name:
        return
    for registry in (AGENTS, PLANTS):
        registry.check(name)
    make_case(name if ":" in name else f"{name}:A")


# ---- Models --------------------------------------------------------------------------------------


def _models() -> list[bytes]:
    import_module("mujoco")  # it starts a program as it is imported

    files = [*(ROOT / "tests/data/models").iterdir(), ROOT / "src/upright/plants/cartpole.urdf"]
    return [path.read_bytes() for path in sorted(files)]


def _read_model(path: Path) -> None:
    from upright.plants.mujoco import Mujoco

    settings = Mujoco(model=str(path))
    settings.found()
    plant = settings.plant()
    plant.reset(State(0.0, 0.0, 0.01, 0.0))
    for force in (1.0, -1.0):
        plant.step(force)


# ---- What other programs send --------------------------------------------------------------------


def _twin_lines() -> list[bytes]:
    line = 'upright {"run": %d, "success": true, "lengths": [13, 600], "seconds": 0.5}\n'
    return [(line % 1 + "warning: x\n" + line % 2).encode(), (line % 2 + line % 1).encode()]


def _read_twin(path: Path) -> None:
    from upright.studies.matlab_twin import TwinJob, _runs_of

    job = TwinJob("q-learning", "default", "none", "random", 600, 1000, 0, (0, 1))
    lines = path.read_bytes().decode(errors="replace").splitlines(keepends=True)
    results = list(_runs_of(iter(lines), job))
    if sorted(result.run for result in results) != [0, 1]:
        raise AssertionError("the twin's runs are others than those asked for")


def _read_gazebo(path: Path) -> None:
    from upright.core.cartpole import has_fallen
    from upright.plants.gazebo.server import STEP, Server, ServerGoneError

    ours, plugin = socket.socketpair()
    with ours, plugin:
        plugin.sendall(path.read_bytes())
        plugin.shutdown(socket.SHUT_WR)
        server = object.__new__(Server)
        server._socket, server._window = ours, None
        with contextlib.suppress(ServerGoneError):
            state = server.ask(STEP, 1, State(1.0, 0.0, 0.0, 0.0))
            if not np.isfinite(state[0] + state[2]) and not has_fallen(Parameters(), state):
                raise AssertionError(f"a pole at {state} has not fallen")


def _messages(kind: str) -> Callable[[], list[bytes]]:
    """Return a function that returns serialised messages, as rclpy writes them."""

    def made() -> list[bytes]:
        from rclpy.serialization import serialize_message
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

        if kind == "joints":
            first = JointState(name=["slider", "hinge"], position=[1.0, 2.0], velocity=[3.0, 4.0])
            second = JointState(name=["hinge", "wheel", "slider"], position=[0.5] * 3)
            second.velocity, second.effort, second.header.frame_id = [1.0] * 3, [1.0], "cart"
            messages: list[Any] = [first, second]
        elif kind == "effort":
            messages = [Float64MultiArray(data=[1.0]), Float64MultiArray(data=[1.0, 2.0])]
            dimension = MultiArrayDimension(label="forces", size=1, stride=1)
            messages.append(Float64MultiArray(data=[-1.0]))
            messages[-1].layout.dim = [dimension]
        else:
            messages = [String(data="Balancing"), String(data="Fault: x"), String()]
        return [serialize_message(message) for message in messages]

    return made


def _read_joints(path: Path) -> None:
    """Read measurements; what is accepted must be what rclpy reads."""
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    from upright.plants.ros2.messages import Joints

    raw, joints = path.read_bytes(), Joints()
    first, again = joints.read(raw), joints.read(raw)
    message = deserialize_message(raw, JointState)
    if first is None:
        return
    slider, hinge = map(list(message.name).index, ("slider", "hinge"))
    places, speeds = message.position, message.velocity
    state = (places[slider], speeds[slider], places[hinge], speeds[hinge])
    stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    for each in (first, again):
        if repr(each) != repr((stamp, State(*state))):
            raise AssertionError(f"read was {each}; rclpy reads {stamp}, {state}")


def _read_effort(path: Path) -> None:
    from rclpy.serialization import deserialize_message
    from std_msgs.msg import Float64MultiArray

    from upright.plants.ros2.messages import read_numbers

    numbers = read_numbers(path.read_bytes())
    expected = list(deserialize_message(path.read_bytes(), Float64MultiArray).data)
    if repr(numbers) != repr(expected):
        raise AssertionError(f"read was {numbers}; rclpy reads {expected}")


def _read_status(path: Path) -> None:
    from rclpy.serialization import deserialize_message
    from std_msgs.msg import String

    from upright.plants.ros2.messages import read_text

    text = read_text(path.read_bytes())
    expected = deserialize_message(path.read_bytes(), String).data
    if text.partition("\0")[0] != expected:
        raise AssertionError(f"read was {text!r}; rclpy reads {expected!r}")


def _text(path: Path) -> str:
    return path.read_bytes().decode(errors="surrogateescape")


NAMES = (
    *("mine:Pd", "mine.py", "mine.py:Pd", "a.b.c:D", "os:system", "antigravity:x", "numpy:zeros"),
    *("q-learning", "../x.py:Z", "/etc/passwd:x", "C:\\x.py:A", "package.module:Class.method"),
)
TARGETS = {
    "policy-npz": Target(_archives, _read_policy, ".npz", share=25),
    "policy-plain": Target(_plain_archives, _read_plain_policy, ".npz", share=15),
    "policy-json": Target(_forms, _read_policy, ".json", share=20),
    "task-file": Target(_task_files, _read_task_file, ".toml", _term_words),
    "study-file": Target(_study_files, _read_study_file, ".toml", _term_words),
    "store": Target(_stores, _read_store, ".sqlite", share=15),
    "settings-file": Target(_settings_files, _read_settings_file, ".toml", _settings_words),
    "terms": Target(_terms, _read_terms, words=_term_words, share=30),
    "parameters": Target(
        _texts("half_length=0.5\ngravity=9.8", "time_step=0.02", "static-friction=0.1"),
        _read_parameters,
        words=lambda: [f"\n{name}=".encode() for name in Parameters._fields],
        share=20,
    ),
    "command-line": Target(_command_lines, _read_command_line, words=_option_words, share=20),
    "code": Target(_texts(PLAIN_AGENT, "def agent(rng): pass\n"), _read_code, ".py"),
    "names": Target(_texts(*NAMES), _read_names),
    "model": Target(_models, _read_model, ".xml", share=3),
    "twin": Target(_twin_lines, _read_twin),
    "gazebo": Target(lambda: [np.arange(4.0).tobytes()], _read_gazebo, ".bin"),
    "ros-joints": Target(_messages("joints"), _read_joints, ".bin", share=15),
    "ros-effort": Target(_messages("effort"), _read_effort, ".bin", share=10),
    "ros-status": Target(_messages("status"), _read_status, ".bin", share=5),
}
"""Every target by name. A new reader of anything from outside belongs here."""
