"""`upright new`: a file that works, whatever its name; and names that are refused."""

import pytest

from upright.commands import make_parser, run
from upright.support.exit_status import BAD_USE


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_it_writes_the_file_and_says_what_to_try(tmp_path, capsys):
    assert run(["new", "pole_keeper.py"]) == 0
    assert "class PoleKeeper:" in (tmp_path / "pole_keeper.py").read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["pole_keeper.py"]
    told = capsys.readouterr().out
    assert "  upright check pole_keeper.py\n" in told
    assert "  upright table --agents pole_keeper:PoleKeeper,random-search --noises none\n" in told


def test_a_compiled_one_is_named_by_its_function(tmp_path, capsys):
    assert run(["new", "pole_keeper.py", "--compiled"]) == 0
    assert "def pole_keeper(rng" in (tmp_path / "pole_keeper.py").read_text()
    assert "--agents pole_keeper:pole_keeper," in capsys.readouterr().out


def test_it_says_where_to_go_if_the_file_is_elsewhere(tmp_path, capsys):
    (tmp_path / "my agents").mkdir()
    assert run(["new", "my agents/first.py"]) == 0
    assert "\n  cd 'my agents'\n  upright check first.py\n" in capsys.readouterr().out
    assert run(["new", str(tmp_path / "second.py")]) == 0
    assert "cd " not in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["file", "folder", "broken link"])
def test_nothing_is_overwritten(tmp_path, capsys, kind):
    path = tmp_path / "mine.py"
    match kind:
        case "file":
            path.write_text("precious")
        case "folder":
            path.mkdir()
        case "broken link":
            path.symlink_to(tmp_path / "nowhere")
    assert run(["new", "mine.py"]) == BAD_USE
    assert "'mine.py'" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["mine.py"]
    assert kind != "file" or path.read_text() == "precious"


@pytest.mark.parametrize(
    ("name", "why", "suggestion"),
    [
        ("my-agent.py", "letters, digits and _", "my_agent.py"),
        ("my agent.py", "letters, digits and _", "my_agent.py"),
        ("a.b.py", "letters, digits and _", "a_b.py"),
        ("2nd.py", "letters, digits and _", "agent_2nd.py"),
        ("été.py", "letters, digits and _", "ete.py"),
        ("弱.py", "letters, digits and _", "agent.py"),
        ("__main__.py", "letters, digits and _", "main.py"),
        ("class.py", "a word of Python", "class_agent.py"),
        ("numpy.py", "hide the module numpy", "numpy_agent.py"),
        ("random.py", "hide the module random", "random_agent.py"),
        ("upright.py", "hide the module upright", "upright_agent.py"),
        ("state.py", "hide 'State'", "state_agent.py"),
        ("mine", "ends in .py", "mine.py"),
        ("mine.txt", "ends in .py", "mine.py"),
        ("", "folder", "my_agent.py"),
        (".", "folder", "my_agent.py"),
    ],
)
def test_a_bad_name_is_refused_with_one_that_works(tmp_path, capsys, name, why, suggestion):
    assert run(["new", name]) == BAD_USE
    told = capsys.readouterr().err
    assert why in told
    assert f"try '{suggestion}'" in told
    assert not list(tmp_path.iterdir())
    assert run(["new", suggestion]) == 0


def test_a_missing_folder_is_named(capsys):
    assert run(["new", "missing/mine.py"]) == BAD_USE
    assert "'missing/mine.py'; its folder does not exist" in capsys.readouterr().err


def test_the_commands_that_it_prints_are_understood(capsys):
    run(["new", "mine.py"])
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
    assert [words[1] for words in lines] == ["check", "learn", "table"]
    for words in lines:
        make_parser().parse([word for word in words[1:] if word != "--window"])
