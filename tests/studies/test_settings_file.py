import re
import tomllib

import pytest

from upright.agents import AGENTS
from upright.commands import run
from upright.errors import UprightError
from upright.studies.settings_file import read_settings, settings_text
from upright.support.exit_status import BAD_USE
from upright.support.settings import values_of, with_values
from upright.support.toml_file import LARGEST


@pytest.mark.parametrize(
    ("agent", "label"), [(agent, label) for agent in AGENTS for label in AGENTS.settings(agent)]
)
def test_settings_are_read_back_as_they_were_written(agent, label, tmp_path):
    settings = AGENTS.settings(agent)[label]
    path = tmp_path / "mine.toml"
    path.write_text(settings_text(agent, settings, {"noises": ["none"], "gain": -1.5}))
    file = read_settings(path)
    assert (file.name, file.agent) == ("mine.toml", agent)
    assert with_values(AGENTS.default(agent), file.values) == settings
    assert tomllib.loads(path.read_text())["found"] == {"noises": ["none"], "gain": -1.5}


def test_a_file_may_leave_out_settings_and_use_former_names_and_whole_numbers(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("agent = 'q-learning'\n[settings]\ntrace = 0.5\nlearning_rate = 1\n")
    settings = with_values(AGENTS.default("q-learning"), read_settings(path).values)
    assert (settings.trace_decay, settings.learning_rate, settings.discount) == (0.5, 1.0, 0.99)
    assert isinstance(settings.learning_rate, float)


Q = "agent = 'q-learning'\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("agent = ", "it is not TOML"),
        (b"\xff\xfe", "it is not TOML"),
        ("[" * 5000, "it is not TOML"),
        ("", "it must have the key agent"),
        (Q, r"the table \[settings\]"),
        ("agent = 3\n[settings]\n", "it must have the key agent"),
        (Q + "colour = 1\n[settings]\n", "key is 'colour'; it must be one of agent, settings"),
        ("agent = 'q-lerning'\n[settings]\n", "did you mean 'q-learning'"),
        ("agent = 'my:Agent'\n[settings]\n", "it has no settings"),
        (Q + "[settings]\nlearning_rat = 1\n", "'learning_rat'.*did you mean 'learning_rate'"),
        (Q + "[settings]\nlearning_rate = 2\n", "learning_rate is 2.0; it must be a number"),
        (Q + "[settings]\nlearning_rate = nan\n", "learning_rate is nan"),
        (Q + f"[settings]\nlearning_rate = {10**400}\n", "learning_rate is a number of more than"),
        (Q + "[settings]\nlearning_rate = true\n", "learning_rate is True; it must be like"),
        (Q + "[settings]\nmirrored = 1\n", "mirrored is 1; it must be like True"),
        (Q + "[settings]\nx_edges = ['a']\n", "x_edges"),
        ("#" * (LARGEST + 1), "it is larger than 1,000,000 bytes"),
        (None, "no such file"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_file_that_is_not_one_of_settings_is_refused_by_its_name(
    content, said, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.toml"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(UprightError, match=f"^settings file is 'mine.toml'; .*{said}"):
        read_settings("mine.toml")
    assert run(["learn", "q-learning", "--settings-file", "mine.toml"]) == BAD_USE
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            Q + "[settings]\n\nlearning_rate = 2\n",
            "line 4, settings.learning_rate: learning_rate is",
        ),
        (Q + "colour = 1\n[settings]\n", "line 2, colour: key is 'colour'"),
        ("\nagent = 'q-lerning'\n[settings]\n", "line 2, agent: agent is 'q-lerning'"),
    ],
)
def test_an_error_names_the_line_and_the_key(content, said, tmp_path):
    (tmp_path / "mine.toml").write_text(content)
    with pytest.raises(UprightError, match=f"mine.toml'; {said}"):
        read_settings(tmp_path / "mine.toml")


def test_only_toml_is_read(tmp_path):
    with pytest.raises(UprightError, match=r"its ending is '.json'; it must be one of .toml"):
        read_settings(tmp_path / "mine.json")


def test_a_text_in_a_file_is_quoted():
    text = settings_text("reinforce", AGENTS.default("reinforce"), {"note": 'a "b"\n\\'})
    assert tomllib.loads(text)["found"]["note"] == 'a "b"\n\\'
    assert re.search(r'^baseline = "fitted"$', text, re.MULTILINE)
    assert values_of(AGENTS.default("reinforce")) == tomllib.loads(text)["settings"]
