"""The MATLAB twin in real Octave: the same physics, noise, learning and policies as the package."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from octave import COMMAND, HAS_COMPILER, MATLAB, octave, octave_numbers
from octave import matrix as in_octave

from upright.agents import AGENTS
from upright.commands import run
from upright.core.cartpole import step
from upright.core.conditions import NOISES, PUBLISHED_NOISES
from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.plants.equations import EquationsSettings
from upright.policies.files import export_policy, load_policy
from upright.reports.published import SOURCES
from upright.reports.statistics import Row, summarise_all
from upright.reports.tables import render
from upright.studies import matlab_twin
from upright.studies.case import make_case
from upright.studies.intervals import bootstrap_interval, wilson_interval
from upright.studies.learned import learned_policy
from upright.studies.playing import case_for, play_trials
from upright.studies.random_streams import twister_numbers
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import stored, study

octave_is_used = pytest.mark.octave
PUBLIC = sorted(path.stem for path in (MATLAB / "+upright").glob("*.m") if path.stem != "Contents")


def lengths(case, seed, run):
    _, result = make_run(case, seed, run, numbers=twister_numbers)
    return result.lengths.tolist()


def octave_curves(agent: str, options: str) -> list[list[int]]:
    """Return the lengths of all trials of runs in Octave's own code."""
    printed = octave(
        f"for r = upright.run_trials('{agent}', {options}, 'mex', false),"
        "fprintf('%d ', r.lengths); fprintf('\\n'); end"
    )
    return [list(map(int, line.split())) for line in printed.splitlines()]


# ------------------------------------------------------------------- the cart-pole and its noise


@octave_is_used
@pytest.mark.parametrize("start", [(0, 0, 0, 0), (0.3, -0.2, 0.1, 0.4), (-1, 2, 3, -4)])
def test_the_plant_agrees_over_a_thousand_bang_bang_pushes(start):
    rights = np.random.default_rng(5).random(1000) < 0.5
    rights[:500:2], rights[1:500:2] = True, False  # then at random: the pole turns over
    state, expected = State(*map(float, start)), []
    for right in rights:
        state = step(Parameters(), state, 10.0 if right else -10.0)
        expected.append(state)
    statements = (
        f"s = {in_octave(start)}; p = upright.parameters(); t = [];"
        f"for f = 10 * (2 * {in_octave(rights)} - 1), s = upright.step(p, s, f); t = [t; s]; end"
    )
    found = octave_numbers(statements, "t").reshape(4, 1000).T
    assert np.abs(found[:, 2]).max() > np.pi
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert (found == np.array(expected)).all()


@octave_is_used
def test_parameters_noises_and_published_figures_are_those_of_the_package():
    told = json.loads(
        octave("""
        [~, names] = upright.noise_case();
        noises = struct('name', {{}}, 'noise', {{}});
        for name = [names, {'all-5', 'all-10'}]
            noises.name{end + 1} = name{1};
            noises.noise{end + 1} = upright.noise_case(name{1});
        end
        figures = @(agent) cellfun(@(n) upright.internal.published(agent, n), names, ...
            'UniformOutput', false);
        disp(upright.internal.to_json(struct('parameters', upright.parameters(), ...
            'names', {names}, 'noises', noises, 'reinforce', {figures('reinforce')}, ...
            'q_learning', {figures('q-learning')})));
    """).replace("NaN", "null")
    )
    ours = Parameters()._asdict()
    assert told["parameters"] == {name: ours[name] for name in told["parameters"]}
    assert not any(ours[name] for name in ours.keys() - told["parameters"].keys())
    assert tuple(told["names"]) == PUBLISHED_NOISES
    noises = dict(zip(told["noises"]["name"], told["noises"]["noise"], strict=True))
    assert noises.keys() == NOISES.keys()
    for name, noise in noises.items():
        assert noise == {size: getattr(NOISES[name], size) for size in noise}
    for agent in ("reinforce", "q-learning"):
        figures = dict(zip(PUBLISHED_NOISES, told[agent.replace("-", "_")], strict=True))
        for source in SOURCES[:4]:
            if source.agent in (None, agent):
                name = source.name.replace(" & ", " and ").replace(" ", "_")
                found = {
                    case: figures[case][name] for case in PUBLISHED_NOISES if figures[case][name]
                }
                assert found == source.mean_trials


@octave_is_used
@pytest.mark.parametrize("agent", matlab_twin.AGENTS)
@pytest.mark.parametrize("label", ["default", "as-published"])
def test_settings_are_those_of_the_package(agent, label):
    ours = AGENTS.settings(agent)
    ours = asdict(ours.get(label, ours["default"]))
    theirs = json.loads(
        octave(f"disp(upright.internal.to_json(upright.settings('{agent}', '{label}')))")
    )
    assert theirs.keys() == ours.keys()
    for name, value in ours.items():
        found = theirs[name]
        found = tuple(found if isinstance(found, list) else [found]) if name in ours else found
        assert found == (value if isinstance(value, tuple) else (value,)), name


@octave_is_used
def test_a_run_draws_what_numpys_twister_gives():
    found = octave_numbers(
        "d = upright.internal.random_streams(upright.internal.stream_number(3, [1 8]));"
        "a = d([1; 2], 1500); b = d(2, 3);",
        "[a(1, :), a(2, :), b]",
    )
    one, other = twister_numbers(3, 0), twister_numbers(3, 7)
    assert found.tolist() == [*one.random(1500), *other.random(1503)]


# -------------------------------------------------------------- one seed, one learning curve


@octave_is_used
@pytest.mark.parametrize(
    ("agent", "noise"),
    [
        pytest.param(*each, marks=() if each == ("random-search", "all-10") else pytest.mark.slow)
        for each in product(matlab_twin.AGENTS, NOISES)
    ],
)
def test_one_seed_is_one_learning_curve_in_both_languages(agent, noise):
    # The sums of reinforce are made in an order that libraries choose, so they differ in time.
    trials = 5 if agent == "reinforce" else 40
    case = make_case(agent, noise=noise, steps=1000, trials=trials)
    options = f"'noise', '{noise}', 'steps', 1000, 'trials', {trials}, 'runs', 4, 'seed', 6"
    assert (curves := octave_curves(agent, options)) == [lengths(case, 6, k) for k in range(4)]
    assert max(map(len, curves)) > 3


@pytest.mark.slow
@octave_is_used
@pytest.mark.parametrize("start", ["zero", "wide"])
def test_as_published_settings_learn_identically_from_other_starts(start):
    curves = octave_curves(
        "q-learning",
        "'settings', upright.settings('q-learning', 'as-published'), 'steps', 400, 'trials', 40,"
        f"'start', '{start}', 'noise', 'sensor-10', 'runs', 2",
    )
    task = {"steps": 400, "trials": 40, "start": start, "noise": "sensor-10"}
    case = make_case("q-learning", "as-published", **task)
    assert curves == [lengths(case, 0, run) for run in range(2)]


@pytest.mark.slow
@octave_is_used
def test_the_readable_learner_makes_the_whole_run_of_the_package():
    found = octave_numbers("r = upright.q_learning('seed', 2, 'run', 3);", "r.lengths")
    case = make_case("q-learning")
    assert found.astype(int).tolist() == lengths(case, 2, 2)
    assert found[-1] == 60_000


@pytest.mark.slow
@octave_is_used
def test_the_twins_own_tests_pass_in_octave():
    """In a process of its own, started as the help of run_tests says."""
    ended = subprocess.run(
        [*COMMAND, "--eval", f"addpath('{MATLAB}'); exit(run_tests() > 0)"],
        capture_output=True,
        text=True,
        timeout=500,
    )
    printed = ended.stdout + ended.stderr
    assert ended.returncode == 0, printed
    passed, failed = map(int, re.search(r"(\d+) passed, (\d+) failed", printed).groups())
    assert (passed > 100, failed) == (True, 0), printed


# ----------------------------------------------------------------------------- statistics, help


@octave_is_used
def test_intervals_agree_with_those_of_the_package():
    trials = np.array([5, 9, 12, 30, 7, 8, 8, 15, 21, 6, 11, 10, 9, 44, 12, 13])
    found = octave_numbers(
        "",
        f"[upright.internal.bootstrap_interval({in_octave(trials)}), "
        "upright.internal.wilson_interval(17, 20)]",
    )
    np.testing.assert_allclose(found[:2], bootstrap_interval(trials), rtol=0.02)
    np.testing.assert_allclose(found[2:], wilson_interval(17, 20), rtol=1e-12)


@octave_is_used
def test_help_explains_every_function_with_an_example():
    named = ", ".join(f"'{name}'" for name in PUBLIC)
    printed = octave(
        f"for name = {{{named}}}, fprintf('=== %s\\n', name{{1}});"
        "disp(help(['upright.' name{1}])); end"
    )
    texts = dict(re.findall(r"=== (\w+)\n(.*?)(?==== |\Z)", printed, re.DOTALL))
    assert sorted(texts) == PUBLIC
    for name, text in texts.items():
        assert text.strip().startswith(name.upper()), name
        assert "Example:" in text, name
    contents = (MATLAB / "+upright" / "Contents.m").read_text()
    for name in PUBLIC:
        assert re.search(rf"\b{name}\b", contents), name


# ------------------------------------------------------------------------------------ policies


@octave_is_used
@pytest.mark.parametrize("agent", AGENTS)
def test_policies_learned_in_python_give_the_same_answers_in_octave(agent, tmp_path):
    case = make_case(agent, steps=2000)
    memory, result = make_run(case, 0, 0)
    assert result.success
    policy = learned_policy(case, 0, 0, memory)
    export_policy(tmp_path / "policy.json", policy)
    rng = np.random.default_rng(3)
    seen = rng.uniform(-1, 1, (300, 4)) * (2.4, 2, 0.2, 2)
    # One after the other, as a policy may look at what came before.
    found = octave_numbers(
        f"p = upright.import_policy('{tmp_path / 'policy.json'}'); h = []; r = [];"
        f"for o = {in_octave(seen)}', [r(end + 1), h] = upright.push_probability(p, o', h); end",
        "r",
    )
    expected = []
    policy.begin_trial(rng)
    for row in seen:
        expected.append(policy.push_probability(State(*row)))
        policy.learn(State(*row), expected[-1] > 0.5, State(*row), False)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.slow
@octave_is_used
@pytest.mark.parametrize("agent", ["q-learning", "reinforce"])
def test_a_policy_learned_in_one_language_balances_in_the_other(agent, tmp_path):
    case = make_case(agent, steps=5000)
    memory, _ = make_run(case, 3, 0, numbers=twister_numbers)
    export_policy(tmp_path / "python.json", learned_policy(case, 3, 0, memory))
    fallen = octave_numbers(
        f"r = upright.run_trials('{agent}', 'steps', 5000, 'runs', 1, 'seed', 3);"
        f"upright.export_policy(r.policy, '{tmp_path / 'octave.json'}');"
        f"p = upright.import_policy('{tmp_path / 'python.json'}');"
        "t = upright.simulate(p, 'steps', 300);",
        "t.fallen",
    )
    assert not fallen
    theirs, ours = (load_policy(tmp_path / f"{name}.json") for name in ("octave", "python"))
    assert theirs.agent == agent
    assert theirs.task["steps"] == 5000
    played = list(play_trials(theirs, case_for(theirs, steps=2000), 3, seed=5))
    assert any(trial.balanced for trial in played)
    # It is the same run, so the same policy.
    assert played == list(play_trials(ours, case_for(ours, steps=2000), 3, seed=5))
    for row in np.random.default_rng(3).uniform(-1, 1, (300, 4)) * (2.4, 2, 0.2, 2):
        assert abs(theirs.push_probability(row) - ours.push_probability(row)) < 1e-6


# ----------------------------------------------------------------------- upright matlab table


@octave_is_used
def test_rows_of_the_twin_appear_beside_those_of_the_package(tmp_path, capsys):
    store = tmp_path / "runs.sqlite"
    same = ["--agents", "q-learning", "--noises", "none,sensor-5", "--runs", "3"]
    same += ["--steps", "500", "--store", str(store)]
    assert run(["matlab", "table", *same, "--format", "json"]) == 0
    rows = [Row.from_data(row) for row in json.loads(capsys.readouterr().out)]
    assert [row.name for row in rows] == ["q-learning (MATLAB)"] * 2
    assert not rows[0].published, "500 steps are not the published task"
    expected = [len(lengths(make_case("q-learning", steps=500), 0, k)) for k in range(3)]
    assert rows[0].mean_trials == pytest.approx(np.mean(expected))
    assert run(["table", *same]) == 0
    assert run(["show", str(store)]) == 0
    printed = capsys.readouterr().out
    assert "q-learning (MATLAB)" in printed
    assert "\nq-learning  " in printed
    languages = [case.language for case, _, _ in stored(store)]
    assert sorted(languages) == ["MATLAB", "MATLAB", "Python", "Python"]


@octave_is_used
def test_only_runs_that_are_missing_are_made(tmp_path):
    case = make_case("random-search", steps=200, language="MATLAB")
    with Store(tmp_path / "runs.sqlite") as store:
        study([case], 2, 0, store)
        told = []
        study([case], 5, 0, store, lambda _, result: told.append(result.run))
        assert sorted(told) == [2, 3, 4]
        ours = make_case("random-search", steps=200)
        for result in store.results(case.key, 0):
            assert result.lengths.tolist() == lengths(ours, 0, result.run)
        (row,) = summarise_all([case], 5, 0, store)
    assert "random-search (MATLAB)" in render([row], "markdown")


def wait_for(condition):
    until = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.1)


def processes_with(text: str) -> list[int]:
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if text in path.read_bytes().decode(errors="replace"):
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


def table_of_guesses(store, seed: int) -> "subprocess.Popen[str]":
    """Start a study in a process of its own; return the process once a run has finished."""
    command = [sys.executable, "-m", "upright", "matlab", "table"]
    # More cases than cores: most of the study is left when the first run has finished.
    command += ["--agents", "random-search", "--noises", "all", "--runs", "100"]
    command += ["--steps", "10000", "--seed", str(seed), "--store", str(store)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: store.exists() and stored(store))
    assert processes_with(f", {seed}, [")
    return process


has_processes = pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="no /proc here")


@pytest.mark.slow
@octave_is_used
@has_processes
def test_an_interrupt_keeps_what_is_done_and_leaves_no_process(tmp_path):
    store = tmp_path / "runs.sqlite"
    with table_of_guesses(store, 4077) as process:
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=120) == 130
        said = process.stderr.read()
    assert f"finished runs are kept in {store}" in said
    assert 0 < sum(len(results) for _, _, results in stored(store)) < 700
    wait_for(lambda: not processes_with(", 4077, ["))


@pytest.mark.slow
@octave_is_used
@has_processes
def test_a_killed_study_leaves_no_process_for_long(tmp_path):
    store = tmp_path / "runs.sqlite"
    with table_of_guesses(store, 4078) as process:
        process.kill()
    wait_for(lambda: not processes_with(", 4078, ["))
    assert 0 < sum(len(results) for _, _, results in stored(store)) < 700


def fake_program(folder: Path, monkeypatch, script: str) -> None:
    program = folder / "some-octave"
    program.unlink(missing_ok=True)  # a worker of the study before may still be running it
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv(matlab_twin.CHOICE, str(program))


def refusal(capsys, *arguments: str) -> str:
    assert run(["matlab", "table", "--runs", "2", "--steps", "100", *arguments]) == 2
    *_progress, line = capsys.readouterr().err.splitlines()
    return line


def test_without_octave_one_line_says_how_to_get_it(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv(matlab_twin.CHOICE, raising=False)
    line = refusal(capsys)
    assert "neither MATLAB nor GNU Octave is on the path" in line
    assert "apt-get install octave" in line
    monkeypatch.setenv(matlab_twin.CHOICE, "no-such-octave")
    assert "UPRIGHT_MATLAB is 'no-such-octave'" in refusal(capsys)


@pytest.mark.skipif(os.name == "nt", reason="it needs a shell")
def test_a_failing_program_is_named_with_its_message(monkeypatch, capsys, tmp_path):
    fake_program(tmp_path, monkeypatch, "echo 'some words'; echo 'error: out of memory'; exit 3")
    line = refusal(capsys)
    assert "some-octave exited with status 3" in line
    assert "error: out of memory" in line
    fake_program(tmp_path, monkeypatch, "exit 0")
    assert "exited without making 2 of its runs" in refusal(capsys)


def test_what_the_twin_cannot_do_is_refused(capsys):
    assert "q-learning, reinforce, random-search" in refusal(capsys, "--agents", "ndp")
    assert "noise is 'storm'" in refusal(capsys, "--noises", "storm")
    assert "4,293" in refusal(capsys, "--seed", "4294")
    with pytest.raises(UprightError, match="twin has only the published parameters and integrator"):
        make_case("q-learning", language="MATLAB", plant=EquationsSettings("rk4"))
    with pytest.raises(UprightError, match="twin has only the published parameters and integrator"):
        make_case("q-learning", language="MATLAB", parameters={"half_length": 1.0})
    with pytest.raises(UprightError, match="language is 'Fortran'; it must be one of"):
        make_case("q-learning", language="Fortran")


def test_modified_settings_are_refused():
    from dataclasses import replace

    case = make_case("q-learning", language="MATLAB")
    changed = replace(case, settings=replace(case.settings, discount=0.5))
    with Store() as store, pytest.raises(UprightError, match="settings are changed"):
        study([changed], 1, 0, store)


def test_the_path_command_prints_the_folder_of_the_twin(capsys):
    assert run(["matlab", "path"]) == 0
    assert (Path(capsys.readouterr().out.strip()) / "+upright" / "step.m").is_file()


def test_learn_can_draw_the_numbers_of_the_twin(capsys):
    arguments = ["learn", "q-learning", "--steps", "300", "--seed", "4", "--run", "2"]
    assert run([*arguments, "--twister"]) == 0
    printed = capsys.readouterr().out
    found = [int(text.replace(",", "")) for text in re.findall(r"([\d,]+) steps  ", printed)]
    assert found == lengths(make_case("q-learning", steps=300), 4, 2)
    assert run([*arguments[:-4], "--seed", "5000", "--twister"]) == 2
    assert "seed of MATLAB's random numbers is 5000" in capsys.readouterr().err


@pytest.mark.slow
@octave_is_used
@pytest.mark.skipif(not HAS_COMPILER, reason="octave-dev or gcc is not installed")
def test_compiled_runs_are_those_of_the_m_code(tmp_path):
    twin = tmp_path / "twin"
    subprocess.run(["cp", "-r", str(MATLAB), str(twin)], check=True)
    printed = octave(
        f"rmpath('{MATLAB}'); addpath('{twin}'); upright.build_mex();"
        "o = {'noise', 'gaussian-0.2', 'steps', 2000, 'runs', 5};"
        "a = upright.run_trials('q-learning', o{:}, 'mex', true);"
        "b = upright.run_trials('q-learning', o{:}, 'mex', false);"
        "for k = 1:5, assert(isequal(a(k).lengths, b(k).lengths));"
        "assert(isequal(a(k).policy, b(k).policy)); end; disp('alike')"
    )
    assert printed.splitlines()[-1] == "alike"
    source = twin / "mex" / "noise.h"
    os.utime(source, (time.time() + 9,) * 2)
    printed = octave(
        f"rmpath('{MATLAB}'); addpath('{twin}'); disp(isempty(upright.internal.built_mex()))"
    )
    assert printed.split() == ["1"]
