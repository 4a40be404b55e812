"""The page on which agents learn in the browser: a folder for any static host."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from upright.agents import AGENTS
from upright.builds.web_package import LIBRARY, write_modules
from upright.core.conditions import NOISES, STARTS
from upright.core.task import TaskSpec
from upright.reports.published import SOURCES
from upright.studies.case import Case, make_case
from upright.support.files import write_file

PAGE = Path(__file__).parent / "page"
"""The files of the page."""
LONGEST_DELAY = 10
"""The longest delay of pushes that a visitor can choose [steps]."""


def build_page(folder: Path | str) -> Iterator[Path]:
    """Write the page, with all agents of the package.

    Parameters
    ----------
    folder
        Where to; it is created if it is missing.

    Yields
    ------
    Path
        Each module, when it is written, and at last the page itself.

    Raises
    ------
    UprightError
        If the linker is missing, or the folder cannot be written.
    """
    yield from write_modules(_cases(), folder)
    place = Path(folder)
    write_file(place / "page.json", json.dumps(_known()))
    for file in [*sorted(PAGE.iterdir()), LIBRARY]:
        write_file(place / file.name, file.read_bytes())
    yield place / "index.html"


def _cases() -> list[Case]:
    """Return all agents, on a rig by which pushes are delayed and visitors push the cart."""
    return [make_case(name, condition=f"delay={LONGEST_DELAY}") for name in AGENTS.built_in]


def _known() -> dict[str, Any]:
    """Return what the page knows besides the modules: what there is, and published figures."""
    return {
        "agents": list(AGENTS.built_in),
        "noises": list(NOISES),
        "starts": list(STARTS),
        "published": _published(),
    }


def _published() -> dict[str, dict[str, dict[str, Any]]]:
    """Return figures by agent, and then by noise and start: what the source of its rule reports."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for source in SOURCES:
        for noise in NOISES:
            for start in STARTS:
                trials = source.figure(TaskSpec(noise=noise, start=start))
                if trials is not None and source.agent is not None:
                    figure = {"name": source.name, "trials": trials}
                    found.setdefault(source.agent, {}).setdefault(f"{noise} {start}", figure)
    return found
