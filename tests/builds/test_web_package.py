"""Learners in Node.js and in Chromium: every bit is that of the same run here."""

import base64
import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from browser import found_in_browser

from upright.agents import AGENTS
from upright.builds.wasm import link
from upright.builds.web_package import build_web
from upright.core.conditions import NOISES
from upright.errors import UprightError
from upright.policies.npz_file import arrays_of
from upright.studies.case import make_case
from upright.studies.run import make_run

HERE = Path(__file__).parent
SHORT = {"steps": 3000, "trials": 25}
SEED, RUN = 7, 3
OPTIONS = json.dumps({"seed": SEED, "run": RUN})
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """Return a function that builds the package of an agent, once."""
    folders = {}

    def package_of(name):
        if name not in folders:
            folders[name] = tmp_path_factory.mktemp("site") / "package"
            # In a process of its own, as others compile agents for this machine before.
            options = [word for key, value in SHORT.items() for word in (f"--{key}", str(value))]
            command = [sys.executable, "-m", "upright", "build", "web", name, *options]
            subprocess.run([*command, "--output", str(folders[name])], check=True)
        return folders[name]

    return package_of


def run_node(program, *arguments):
    done = subprocess.run(
        ["node", str(HERE / program), *map(str, arguments)], capture_output=True, text=True
    )
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)


def assert_same(found, name, layout):
    """Compare what a module learned with what is learned here, array by array."""
    case = make_case(name, noise=found["noise"], **SHORT)
    agent, result = make_run(case, SEED, RUN)
    assert (found["success"], found["lengths"]) == (result.success, result.lengths.tolist())
    memory = base64.b64decode(found["memory"])
    assert len(memory) == layout["size"]
    for place, value in arrays_of(agent, "agent."):
        where = layout["places"][place]
        assert (where["type"], where["shape"]) == (value.dtype.name, list(value.shape)), place
        offset = where["offset"]
        assert memory[offset : offset + value.nbytes] == value.tobytes(), place


def layout_of(folder, name):
    return json.loads((folder / f"{name}.json").read_text())


@pytest.mark.wasm
@pytest.mark.parametrize("name", AGENTS.built_in)
def test_node_learns_the_same_to_the_bit(package, name):
    folder = package(name)
    found = run_node("proof_in_node.mjs", folder, name, json.dumps([*NOISES]), OPTIONS)
    assert [each["noise"] for each in found] == [*NOISES]
    for each in found:
        assert_same(each, name, layout_of(folder, name))


@pytest.mark.wasm
@pytest.mark.chromium
@pytest.mark.parametrize("name", AGENTS.built_in)
def test_chromium_learns_the_same_to_the_bit(package, name):
    folder = package(name)
    for file in ("proof.js", "proof_in_browser.html"):
        shutil.copy(HERE / file, folder.parent)
    asked = {"name": name, "noises": json.dumps([*NOISES]), "options": OPTIONS}
    found = found_in_browser(folder.parent, "proof_in_browser.html", **asked)
    assert isinstance(found, list), found
    assert [each["noise"] for each in found] == [*NOISES]
    for each in found:
        assert_same(each, name, layout_of(folder, name))


@pytest.mark.wasm
@pytest.mark.parametrize("name", AGENTS.built_in)
def test_a_module_is_small(package, name):
    assert (package(name) / f"{name}.wasm").stat().st_size < 40_000


@pytest.mark.wasm
def test_a_module_imports_nothing_but_memory(package):
    code = f"""
        const module = new WebAssembly.Module(
          require("node:fs").readFileSync({str(package("q-learning") / "q-learning.wasm")!r}));
        console.log(WebAssembly.Module.imports(module).map((each) => each.name).join());"""
    done = subprocess.run(["node", "-e", code], capture_output=True, text=True, check=True)
    assert done.stdout == "memory\n"


# ---- What a page can change ----------------------------------------------------------------------


def learned_in_node(folder, name, options):
    (found,) = run_node(
        "proof_in_node.mjs", folder, name, '["none"]', json.dumps({"seed": SEED, **options})
    )
    return found["lengths"]


@pytest.mark.wasm
def test_a_page_chooses_the_task(package):
    options = {"start": "wide", "parameters": {"half_length": 0.3}, "steps": 400, "trials": 9}
    case = make_case("q-learning", **options)
    found = learned_in_node(package("q-learning"), "q-learning", options)
    assert found == make_run(case, SEED, 0)[1].lengths.tolist()


@pytest.mark.wasm
@pytest.mark.parametrize("name", AGENTS.built_in)
def test_a_page_changes_settings(package, name):
    """Each that the layout lists, and the trials are those of an agent made with it."""
    settings = AGENTS.default(name)
    places = layout_of(package(name), name)["settings"]
    changed = {
        each: getattr(settings, each) + 1
        if isinstance(getattr(settings, each), int)
        else getattr(settings, each) * 0.93
        for each in places
    }
    case = make_case(name, settings=changed, **SHORT)
    found = learned_in_node(package(name), name, {"settings": changed})
    assert found == make_run(case, SEED, 0)[1].lengths.tolist()


@pytest.mark.wasm
def test_a_condition_travels_and_a_page_shortens_a_delay(tmp_path):
    condition = "delay={},at-300.half_length=0.7,gust=3"
    case = make_case("q-learning", condition=condition.format(5), **SHORT)
    [*build_web([case], tmp_path)]
    program = f"""
        import {{ load }} from "{(tmp_path / "upright.js").as_uri()}";
        const learner = await (await load("q-learning")).create({{ seed: {SEED} }});
        const first = learner.run().lengths;
        learner.begin({{ seed: {SEED} }});
        learner.set("task.rig.delay", 1);
        console.log(JSON.stringify([first, learner.run().lengths]));"""
    command = ["node", "--input-type=module", "-e", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    for delay, lengths in zip((5, 1), json.loads(done.stdout), strict=True):
        case = make_case("q-learning", condition=condition.format(delay), **SHORT)
        assert lengths == make_run(case, SEED, 0)[1].lengths.tolist()


@pytest.mark.wasm
def test_settings_that_are_numbers_can_be_changed(package):
    places = layout_of(package("q-learning"), "q-learning")["settings"]
    assert {"learning_rate", "discount"} <= set(places)


@pytest.mark.wasm
@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"seed": -1}, "seed is -1; it must be a number from 0 to 4294967295"),
        ({"noise": "loud"}, 'noise is "loud"; it must be one of none, actuator-5'),
        ({"parameters": {"mass": 1}}, 'parameter is "mass"; it must be one of gravity'),
        ({"parameters": {"force": -1}}, "force is -1; it must be a number from 1e-12"),
        ({"settings": {"boxes": 1}}, 'setting is "boxes"; it must be one of learning_rate'),
        ({"trials": 26}, "trials is 26; it must be a number from 1 to 25"),
        ({"steps": 0.5}, "steps is 0.5; it must be"),
        ({"speed": 2}, 'option is "speed"; it must be one of seed'),
    ],
)
def test_bad_options_are_refused(package, options, error):
    folder, program = package("q-learning"), str(HERE / "proof_in_node.mjs")
    command = ["node", program, str(folder), "q-learning", '["none"]']
    if "noise" in options:
        command[-1] = json.dumps([options.pop("noise")])
    done = subprocess.run([*command, json.dumps(options)], capture_output=True, text=True)
    assert f"RangeError: {error}" in done.stderr


# ---- The package ---------------------------------------------------------------------------------


@pytest.mark.wasm
def test_types_are_declared_for_all_that_the_module_has(package):
    folder = package("q-learning")
    code, types = ((folder / f"upright.{end}").read_text() for end in ("js", "d.ts"))
    members = re.compile(r"^  (?:async |get |set |readonly )*(\w+)(?=\(|: |\?: )", re.MULTILINE)
    for name in ("LearnerModule", "Learner"):
        body, declared = (
            text.partition(f"class {name} {{")[2].partition("\n}")[0] for text in (code, types)
        )
        fields = {"layout", "module"} if name == "LearnerModule" else {"layout"}
        assert set(members.findall(declared)) - {"constructor"} == (
            set(members.findall(body)) - {"constructor"} | fields
        )


@pytest.mark.wasm
@pytest.mark.skipif(shutil.which("npm") is None, reason="npm is missing")
def test_the_folder_is_an_npm_package(package):
    command = ["npm", "pack", "--dry-run", "--json", str(package("q-learning"))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    (packed,) = json.loads(done.stdout)
    assert {file["path"] for file in packed["files"]} == {
        *("index.html", "index.js", "learners.json", "package.json", "upright.d.ts", "upright.js"),
        *("q-learning.json", "q-learning.wasm"),
    }


@pytest.mark.wasm
def test_a_killed_build_leaves_whole_files_and_the_same_command_goes_on(package, tmp_path):
    """Killed once its first file is there, of two agents."""
    names, place = ["random-search", "q-learning"], tmp_path / "page"
    command = [sys.executable, "-m", "upright", "build", "web", *names, "--output", str(place)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as build:
        while not (place / "random-search.json").exists():
            assert build.poll() is None
            time.sleep(0.01)
        build.kill()
    assert not (place / "q-learning.wasm").exists()
    for file in place.glob("*.json"):
        assert json.loads(file.read_text())
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"module: {place / name}.wasm" for name in names]
    assert {file.name for file in place.iterdir()} == {
        *(file.name for file in package("q-learning").iterdir()),
        *("random-search.json", "random-search.wasm"),
    }


@pytest.mark.wasm
def test_a_linker_that_fails_is_reported():
    with pytest.raises(UprightError, match=r"failed: .*learner\.o"):
        link(b"no object file", ())


def test_a_missing_linker_is_reported(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(UprightError, match="wasm-ld is missing: it is in the package lld"):
        [*build_web([make_case("q-learning")], tmp_path / "page")]
    assert not (tmp_path / "page").exists()
