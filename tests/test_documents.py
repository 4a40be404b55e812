"""What README and docs show is true: Python runs, command lines are understood, output is current.

What cannot run here is listed below, each with its reason.
"""

import re
import shlex
import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest
from helpers import ROOT, forget
from markdown_it import MarkdownIt

import upright
from upright.commands import main, make_parser

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/*.md"))]

PYTHON_NOT_RUN = {
    "import stable_baselines3": "needs Stable-Baselines3, some gigabytes",
    "class Cart(Node)": "is a part of examples/ros2_cart.py, which is tested",
}
"""Python that is only compiled: what stands in it, and why."""
COMMANDS_NOT_RUN = {
    "check": "takes a quarter of a minute, and has tests of its own",
    "gazebo": "needs Gazebo",
    "matlab table": "needs Octave",
    "reproduce": "takes minutes",
    "ros2": "needs ROS 2, and runs until it is stopped",
    "study": "needs its file, and has tests of its own",
    "table": "takes minutes",
    "tune": "takes minutes",
    "watch": "runs until it is stopped, and has tests of its own",
    "--plant": "needs the simulator",
    "--video": "takes half a minute, and has tests of its own",
    "--window": "needs a display",
    "my_learners:PPO --noise": "needs Stable-Baselines3",
    "--format parquet": "needs PyArrow, and has tests of its own",
}
"""Command lines that are only parsed: words that stand in them, and why."""


class Block(NamedTuple):
    """A block of code in a document."""

    page: Path
    line: int
    language: str
    text: str

    @property
    def place(self):
        return f"{self.page.relative_to(ROOT).as_posix()}:{self.line}"


class Command(NamedTuple):
    """A command line in a document, and the output that stands below it."""

    place: str
    words: list[str]
    output: list[str]

    @property
    def line(self):
        return shlex.join(self.words)


def is_quick(command):
    """Return whether a command line can run here."""
    return not any(words in command.line for words in COMMANDS_NOT_RUN)


def blocks(page):
    """Return the blocks of code of a document."""
    tokens = MarkdownIt().parse(page.read_text())
    fences = (token for token in tokens if token.type == "fence")
    return [Block(page, token.map[0] + 2, token.info.strip(), token.content) for token in fences]


def commands(block):
    """Give the command lines of `upright` in a block for a shell."""
    lines = block.text.replace("\\\n", " ").splitlines()
    prompt = "$ " if block.language == "console" else ""
    for number, line in enumerate(lines):
        if not line.startswith(prompt):
            continue
        below = lines[number + 1 :] if prompt else []
        ends = [i for i, text in enumerate(below) if text.startswith(prompt)]
        output = below[: ends[0] if ends else None]
        for words in split(line.removeprefix(prompt)):
            if Path(words[0]).name == "upright":
                yield Command(block.place, words[1:], output)


def split(line):
    """Return the commands of a line, each as its words."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="&;|<>")
    lexer.whitespace_split = True
    found = [[]]
    for word in lexer:
        if set(word) <= set("&;|"):
            found.append([])
        else:
            found[-1].append(word)
    return [words for words in found if words]


BLOCKS = [block for page in PAGES for block in blocks(page)]
SHELL = [block for block in BLOCKS if block.language in ("sh", "console")]
COMMANDS = [command for block in SHELL for command in commands(block)]


def by_place(things):
    return {"argvalues": things, "ids": [thing.place for thing in things]}


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with the files that documents speak of, as the commands before would make them."""
    folder = tmp_path_factory.mktemp("documents")
    policy, _ = upright.learn("reinforce", seed=1)
    for name in ("policy.npz", "results/reinforce.npz"):
        (folder / name).parent.mkdir(exist_ok=True)
        upright.save_policy(folder / name, policy)
    for name in ("policy.onnx", "policy.json", "mine.json"):
        upright.export_policy(folder / name, policy)
    cases = [upright.make_case("random-search", noise=n, steps=300) for n in ("none", "sensor-5")]
    with upright.Store(folder / "runs.sqlite") as store:
        upright.study(cases, runs=3, store=store)
    for machine in ("laptop", "server", "ndp.1-of-2", "ndp.2-of-2"):
        shutil.copy(folder / "runs.sqlite", folder / f"{machine}.sqlite")
    lengths = [{"half_length": length} for length in (0.5, 1.0)]
    swept = [upright.make_case("random-search", parameters=p, steps=300) for p in lengths]
    with upright.Store(folder / "sweep.sqlite") as store:
        upright.study(swept, runs=3, store=store)
    learner = "class PPO:\n    def __init__(self, rng): ...\n\n    def train(self, env): ...\n"
    (folder / "my_learners.py").write_text(learner)
    shutil.copy(ROOT / "tests/data/models/sideways.urdf", folder / "my_cart.urdf")
    return folder


@pytest.fixture
def folder(prepared, tmp_path, monkeypatch):
    """A copy of that folder, as the present one."""
    shutil.copytree(prepared, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT)  # a reader stands in the clone, where examples/ is
    return tmp_path


def python_blocks(page):
    return [block for block in blocks(page) if block.language == "python"]


@pytest.mark.slow
@pytest.mark.parametrize("page", list(filter(python_blocks, PAGES)), ids=lambda page: page.name)
def test_python_runs(page, folder, capsys, monkeypatch):
    """The blocks of a page run one after the other, as a reader would enter them.

    A block of output shows what the one before it prints.
    """
    main = ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", main)
    for block in blocks(page):
        if block.language == "output":
            assert capsys.readouterr().out == block.text, block.place
        if block.language != "python":
            continue
        capsys.readouterr()
        code = compile("\n" * (block.line - 1) + block.text, page, "exec")
        if not any(words in block.text for words in PYTHON_NOT_RUN):
            exec(code, vars(main))


def call(words, monkeypatch):
    monkeypatch.setattr("sys.argv", ["upright", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


@pytest.mark.parametrize("command", **by_place(COMMANDS))
def test_command_lines_are_understood(command):
    """They are parsed and nothing more: some would take hours, or install Gazebo."""
    options = make_parser().parse(command.words)
    assert callable(options.command)


def steady(line):
    """Return a line of output without what differs from machine to machine."""
    return re.sub(r"took [\d.]+ s", "took … s", line.rstrip())


@pytest.mark.slow
@pytest.mark.parametrize("block", **by_place([b for b in SHELL if any(map(is_quick, commands(b)))]))
def test_quick_commands_run_and_print_what_is_shown(block, folder, monkeypatch, capsys):
    for name in ("my_agent", "second_agent"):  # of another block, which wrote it elsewhere
        forget(name)
    for command in filter(is_quick, commands(block)):
        status = call(command.words, monkeypatch)
        printed = capsys.readouterr()
        assert status == 0, (command.line, printed.err)
        expected = list(map(steady, command.output))
        if "..." in expected:
            expected = expected[: expected.index("...")]
        assert list(map(steady, printed.out.splitlines()))[: len(expected)] == expected


@pytest.mark.parametrize("words", PYTHON_NOT_RUN)
def test_what_is_listed_as_not_run_is_there(words):
    assert any(words in block.text for block in BLOCKS)


@pytest.mark.parametrize("words", COMMANDS_NOT_RUN)
def test_what_is_listed_as_only_parsed_is_there(words):
    assert any(words in command.line for command in COMMANDS)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_is_imported_from_the_package_itself(page):
    for block in python_blocks(page):
        assert not re.search(r"(?:from|import) upright\.", block.text), block.place


@pytest.mark.parametrize("path", sorted(ROOT.glob("examples/*.py")), ids=lambda path: path.name)
def test_examples_import_from_the_package_itself(path):
    assert not re.search(r"(?:from|import) upright\.", path.read_text())


def test_no_document_installs_what_no_index_has():
    for page in [*PAGES, *ROOT.glob("examples/**/*.*"), *ROOT.glob("benchmarks/*.*")]:
        assert not re.search(r"pip install ['\"]?upright(?!-[0-9]|_)", page.read_text()), page


def test_the_readme_names_the_wheel_of_this_version():
    (name,) = set(re.findall(r"upright-[\d.]+-py3-none-any\.whl", (ROOT / "README.md").read_text()))
    assert name == f"upright-{upright.__version__}-py3-none-any.whl"


@pytest.mark.parametrize(
    "line",
    ["upright lean", "upright learn", "upright learn reinforce --loud", "upright play --seed x"],
)
def test_a_wrong_command_line_would_be_noticed(line):
    with pytest.raises((SystemExit, upright.UprightError)):
        make_parser().parse(shlex.split(line)[1:])
