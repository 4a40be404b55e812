"""A folder of learners for browsers and Node.js: modules, their layouts, and a page.

It is an npm package, and any static host serves it.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from upright import __version__
from upright.agents import is_custom
from upright.builds.learner import Built, build_learner
from upright.builds.numba_inside import leaves_of
from upright.builds.wasm import STACK, WASM, find_linker, link
from upright.core.conditions import NOISES, STARTS, condition_of, noise_of
from upright.core.parameters import LARGEST, Parameters, lowest
from upright.errors import UprightError
from upright.studies.case import Case
from upright.studies.random_streams import random_numbers
from upright.studies.run import new_agent
from upright.support.files import make_folder, write_file
from upright.support.settings import describe_settings

PAGE = Path(__file__).parent / "page"
"""The files that are the same whatever is built."""
LIBRARY = PAGE / "upright.js"
"""The file that makes learners of modules."""
PAGE_OF_MEMORY = 65536


def build_web(cases: Sequence[Case], folder: Path | str) -> Iterator[Path]:
    """Write the modules of learners and all that a page needs.

    Parameters
    ----------
    cases
        Agents with their settings, each on its task.
    folder
        Where to; it is created if it is missing.

    Yields
    ------
    Path
        Each module, when it is written. The page needs them all.

    Raises
    ------
    UprightError
        If an agent cannot be built, the linker is missing, or the folder cannot be written.
    """
    yield from write_modules(cases, folder)
    place = Path(folder)
    for file in sorted(PAGE.iterdir()):
        write_file(place / file.name, file.read_bytes())
    names = [module_name(case) for case in cases]
    write_file(place / "learners.json", json.dumps(names) + "\n")
    write_file(place / "package.json", json.dumps(npm_package(names), indent=2) + "\n")


def write_modules(cases: Sequence[Case], folder: Path | str) -> Iterator[Path]:
    """Write the modules of learners alone, each with its JSON file, to a folder; yield each.

    Raises
    ------
    UprightError
        As above, and then before the folder is created.
    """
    names = [module_name(case) for case in cases]
    for name, case in zip(names, cases, strict=True):
        if names.count(name) > 1:
            raise UprightError(
                f"agent is {case.agent!r}; there would be several modules of its name"
            )
        check_seedable(case)
    find_linker()
    place = make_folder(folder)
    for name, case in zip(names, cases, strict=True):
        built = build_learner(case, WASM)
        code = link(built.code, built.names)
        write_file(place / f"{name}.json", json.dumps(layout(case, built), separators=(",", ":")))
        write_file(place / f"{name}.wasm", code)
        yield place / f"{name}.wasm"


def module_name(case: Case) -> str:
    """Return what the module of a case is called: as its agent, without a colon."""
    return case.agent.replace(":", ".")


def check_seedable(case: Case) -> None:
    """Raise UprightError if each run has its own plant, which is drawn before the run begins."""
    condition = condition_of(case.spec.condition)
    if condition.varies_plant or condition.each_run:
        raise UprightError(
            f"condition is {case.spec.condition!r}; each run has its own plant there, which only "
            "the package draws; build without it, and set the parameters of each learner"
        )


def layout(case: Case, built: Built) -> dict[str, Any]:
    """Return what a page needs to know of a module: where everything is, and what it may be."""
    return {
        "agent": case.agent,
        "version": __version__,
        "size": built.memory.size,
        "pages": -(-(STACK + 2 * built.memory.size) // PAGE_OF_MEMORY) + 1,
        "places": built.memory.layout(),
        "noises": {name: _sizes(name) for name in NOISES},
        "starts": {name: start._asdict() for name, start in STARTS.items()},
        "parameters": {name: _parameter(case, name) for name in Parameters._fields},
        "settings": {} if is_custom(case.agent) else changeable_settings(case),
    }


def _sizes(noise: str) -> dict[str, float]:
    """Return the sizes of a noise case, without what a condition says."""
    sizes = noise_of(noise)._asdict()
    del sizes["hides_velocities"]
    return {name: float(size) for name, size in sizes.items()}


def _parameter(case: Case, name: str) -> dict[str, Any]:
    value = getattr(case.spec.parameters, name)
    text = describe_settings(Parameters)[name]
    return {"value": value, "low": lowest(name), "high": LARGEST, "meaning": text}


def changeable_settings(case: Case) -> dict[str, str]:
    """Return the places of the settings that are one number in the agent's memory, and no more."""
    usual = _content(case)
    found = {}
    for name, value in vars(case.settings).items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        other = value + 1 if isinstance(value, int) else 0.93 * value + 1e-6
        try:
            content = _content(replace(case, settings=replace(case.settings, **{name: other})))
        except UprightError:  # not allowed with the others
            continue
        differing = [each for each in usual if not np.array_equal(usual[each], content[each])]
        if len(differing) != 1:
            continue
        place = differing[0]
        if np.array_equal([usual[place], content[place]], [value, other]):
            found[name] = place
    return found


def _content(case: Case) -> dict[str, Any]:
    """Return all numbers and arrays of a new agent, by name."""
    agent = new_agent(case, random_numbers(0, 0))
    return {leaf.name: leaf.value for leaf in leaves_of("agent", agent)}


def npm_package(names: Sequence[str]) -> dict[str, Any]:
    """Return the package.json of a folder of modules."""
    modules = [f"{name}.{ending}" for name in names for ending in ("json", "wasm")]
    return {
        "name": "upright-learners",
        "version": __version__,
        "description": "Learners that balance an inverted pendulum, from falling, as WebAssembly.",
        "license": "MIT",
        "type": "module",
        "exports": {
            ".": {"types": "./upright.d.ts", "default": "./upright.js"},
            "./*": "./*",
        },
        "files": [*(file.name for file in sorted(PAGE.iterdir())), "learners.json", *modules],
    }
