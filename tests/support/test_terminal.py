import ast
import io
import os
import pty
import sys
from contextlib import redirect_stderr

from helpers import python

from upright.agents import AGENTS
from upright.core.parameters import Parameters
from upright.nodes.settings import LearnerSettings, SimulatorSettings
from upright.plants import PLANTS
from upright.support import terminal
from upright.support.files import PACKAGE
from upright.support.settings import describe_settings
from upright.support.terminal import SIGNS, end_notice, notice, prepare_streams, printable, width


def written(monkeypatch, encoding, text, **environment):
    """Return the bytes that a stream of this encoding gets."""
    for name in ("LC_ALL", "PYTHONIOENCODING", "PYTHONUTF8"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    prepare_streams()
    print(text, end="", flush=True)
    return stream.buffer.getvalue()


def test_signs_are_replaced_only_where_an_encoding_lacks_them(monkeypatch):
    text = "█ ±6° α × − …"
    assert written(monkeypatch, "utf-8", text) == text.encode()
    assert written(monkeypatch, "ascii", text) == b"# +/-6 deg alpha x - ..."
    assert written(monkeypatch, "latin-1", text) == "# ±6° alpha × - ...".encode("latin-1")


def test_signs_of_others_become_their_numbers(monkeypatch):
    assert written(monkeypatch, "ascii", "naïve 棒") == rb"na\xefve \u68d2"
    assert written(monkeypatch, "utf-8", "undecodable \udcff") == rb"undecodable \udcff"


def test_the_c_locale_asks_for_ascii_unless_python_is_told_otherwise(monkeypatch):
    for name in ("C", "POSIX"):
        assert written(monkeypatch, "utf-8", "±", LC_ALL=name) == b"+/-"
    assert written(monkeypatch, "utf-8", "±", LC_ALL="C.UTF-8") == "±".encode()
    assert written(monkeypatch, "utf-8", "±", LC_ALL="C", PYTHONUTF8="1") == "±".encode()
    asked = {"LC_ALL": "C", "PYTHONIOENCODING": "utf-8"}
    assert written(monkeypatch, "utf-8", "±", **asked) == "±".encode()


def test_a_stream_that_cannot_be_changed_is_left_alone(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    prepare_streams()
    print("±")
    assert sys.stdout.getvalue() == "±\n"
    assert printable("±") == "±"


def texts_in(path):
    """Give the texts of a module that are no docstrings; of a command, the docstring too."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(text, str) and id(node) not in documents:
            yield text
    if "commands" in path.parts:
        yield ast.get_docstring(tree)


def test_every_sign_that_the_package_prints_has_a_substitute():
    texts = [text for path in PACKAGE.rglob("*.py") for text in texts_in(path)]
    for registry in (AGENTS, PLANTS):
        texts += [registry.summary(name) for name in registry.built_in]
        for name in registry.built_in:
            texts += describe_settings(registry.default(name)).values()
    for kind in (Parameters, LearnerSettings, SimulatorSettings):
        texts += describe_settings(kind).values()
    signs = {sign for text in texts for sign in text if not sign.isascii()}
    assert {"█", "°", "α"} <= signs
    assert signs <= set(SIGNS)
    assert all(text.isascii() for text in SIGNS.values())


def test_the_width_is_what_columns_says_else_that_of_the_terminal_else_80(monkeypatch):
    monkeypatch.setenv("COLUMNS", "133")
    assert width() == width(to_file=True) == 133
    for value in ("", "0", "wide", "-5"):
        monkeypatch.setenv("COLUMNS", value)
        monkeypatch.setattr(os, "get_terminal_size", lambda _fd: os.terminal_size((97, 24)))
        assert (width(), width(to_file=True)) == (97, 80)
    monkeypatch.delenv("COLUMNS")
    ended = python("from upright.support.terminal import width; print(width())")
    assert ended.stdout == "80\n"  # a pipe


def test_a_notice_goes_again():
    ours, its = pty.openpty()
    stream = os.fdopen(its, "w", encoding="ascii", errors=terminal.HANDLER)
    with stream, redirect_stderr(stream):
        notice("wait …")
        assert os.read(ours, 1000) == b"wait ..."
        end_notice()
        assert os.read(ours, 1000) == b"\r        \r"
        end_notice()
        print("next", end="", file=sys.stderr, flush=True)
        assert os.read(ours, 1000) == b"next"
    os.close(ours)


def test_nobody_is_told_where_nobody_watches(capsys):
    notice("wait")
    end_notice()
    assert capsys.readouterr().err == ""
