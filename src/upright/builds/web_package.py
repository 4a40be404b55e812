"""A folder of learners for browsers and Node.js: modules, their layouts, and a page.

It is an npm package, and any static host serves it.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from upright import __version__
from upright.builds.folders import own_folder
from upright.builds.layout import places
from upright.builds.learner import Built, build_learner
from upright.builds.wasm import STACK, WASM, find_linker, link
from upright.core.conditions import NOISES, STARTS, condition_of, noise_of
from upright.core.parameters import LARGEST, Parameters, lowest
from upright.errors import UprightError
from upright.studies.case import Case
from upright.support.files import write_file
from upright.support.settings import describe_settings

PAGE = Path(__file__).parent / "page"
"""The files that are the same whatever is built."""
EXPORTS = ("begin", "seed", "advance", "push_probability")
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
    names = [module_name(case) for case in cases]
    for name, case in zip(names, cases, strict=True):
        if names.count(name) > 1:
            raise UprightError(
                f"agent is {case.agent!r}; there would be several modules of its name"
            )
        check_seedable(case)
    find_linker()
    place = own_folder(folder)
    for name, case in zip(names, cases, strict=True):
        built = build_learner(case, WASM)
        code = link(built.code, [each for each in EXPORTS if each in built.names])
        write_file(place / f"{name}.json", json.dumps(layout(case, built), indent=1) + "\n")
        write_file(place / f"{name}.wasm", code)
        yield place / f"{name}.wasm"
    for file in sorted(PAGE.iterdir()):
        write_file(place / file.name, file.read_bytes())
    write_file(place / "learners.json", json.dumps(names) + "\n")
    write_file(place / "package.json", json.dumps(npm_package(names), indent=2) + "\n")


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
        "places": places(built.memory),
        "noises": {name: _sizes(name) for name in NOISES},
        "starts": {name: start._asdict() for name, start in STARTS.items()},
        "parameters": {name: _parameter(case, name) for name in Parameters._fields},
        "settings": _settings(case, built),
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


def _settings(case: Case, built: Built) -> dict[str, str]:
    """Return the places of the settings that are numbers in the agent's memory."""
    found = {}
    for name, value in vars(case.settings).items():
        places = [
            place.name
            for place in built.memory.places.values()
            if place.name.startswith("agent.") and place.name.endswith(f".{name}")
        ]
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if is_number and len(places) == 1 and not built.memory.places[places[0]].shape:
            found[name] = places[0]
    return found


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
