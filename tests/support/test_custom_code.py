"""Names of custom code, `module:name`, which may be anything."""

import sys

import pytest

from upright.agents.custom import CustomAgent
from upright.errors import AgentError, UprightError
from upright.plants.custom import CustomPlant
from upright.support.code_names import statements

OF_PYTHON = (
    "os:system",
    "os:abort",
    "os.path:join",
    "builtins:exec",
    "sys:exit",
    "antigravity:x",
    "this:x",
    "idlelib.idle:x",
)
NOWHERE = (
    *("", ":", ":x", "x:", "::", "a:b:c", ".:x", "..:x", "..a:b", "/etc/passwd", "/etc/passwd:x"),
    *("../x.py", "../x.py:Z", "a\0b:x", "a:b\0", "x.py:\0", "\0.py", "a\n:b", "a:b\nc"),
    *("os:\ud800", "\ud800:x", "é:x", f"{'a' * 10_000}:b", f"a:{'b' * 10_000}"),
    *(f"{'a' * 10_000}.py", f"{'a/' * 3000}:x", "a." * 100 + "a:x"),
)


@pytest.mark.parametrize("kind", [CustomAgent, CustomPlant])
@pytest.mark.parametrize("name", OF_PYTHON)
def test_modules_of_python_are_neither_imported_nor_called(name, kind):
    module = name.partition(":")[0]
    was_there = module in sys.modules
    with pytest.raises(UprightError, match=f"{module} is a module of Python itself") as caught:
        kind(name).code.call(None, "nothing")
    assert "\n" not in str(caught.value)
    assert (module in sys.modules) is was_there


def test_a_file_of_the_users_own_may_have_the_name_of_a_module_of_python(write):
    name = write("def agent(rng): return 13", "antigravity")
    assert CustomAgent(f"{name}:agent").code.call(None, "nothing") == 13


@pytest.mark.parametrize("kind", [CustomAgent, CustomPlant])
@pytest.mark.parametrize("name", NOWHERE, ids=range(len(NOWHERE)))
def test_names_that_lead_nowhere_are_refused_in_one_line(name, kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UprightError) as caught:
        kind(name).code.find()
    assert not isinstance(caught.value, AgentError)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    "raised", ["SystemExit(0)", "GeneratorExit()", "BaseException('odd')", "Odd()"]
)
@pytest.mark.parametrize("place", ["module", "attribute", "function"])
def test_whatever_custom_code_raises_is_reported(raised, place, write):
    where = {
        "module": f"raise {raised}",
        "attribute": f"def __getattr__(name):\n    if name == 'agent': raise {raised}",
        "function": f"def agent(rng): raise {raised}",
    }
    odd = "class Odd(BaseException):\n    def __str__(self): raise ValueError\n"
    with pytest.raises(AgentError, match="agent is 'outside_") as caught:
        CustomAgent(f"{write(odd + where[place])}:agent").agent(None)
    assert raised.partition("(")[0] in str(caught.value)


@pytest.mark.parametrize("place", ["module", "function"])
def test_an_interrupt_in_custom_code_is_one(place, write):
    where = {"module": "", "function": "def agent(rng): "}
    with pytest.raises(KeyboardInterrupt):
        CustomAgent(f"{write(where[place] + 'raise KeyboardInterrupt')}:agent").agent(None)


def test_an_error_without_a_line_of_custom_code_takes_one_line():
    with pytest.raises(AgentError) as caught:
        CustomAgent("numpy:zeros").agent(None)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["class", "\0", "\xff", "(" * 10_000, "-" * 10**5 + "1"])
def test_what_is_not_python_has_no_statements(text, tmp_path):
    path = tmp_path / "odd.py"
    path.write_bytes(text.encode("latin-1"))
    assert statements(path) is None
    assert statements(tmp_path / "missing.py") is None
