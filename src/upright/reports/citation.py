"""How to cite this software, and the works that its task and its agents are from."""

import json
import textwrap
from typing import NamedTuple

from upright import __version__
from upright.reports.tables import UNBROKEN
from upright.support import terminal

TITLE = "Upright: learning to balance an inverted pendulum, fast and honestly measured"
AUTHORS = "The Upright authors"
LICENSE = "MIT"
RELEASED = "2026-11-26"
"""Day on which this version was released, as YEAR-MONTH-DAY."""


class Article(NamedTuple):
    """An article that something in this package is from."""

    key: str
    """Its name in BibTeX."""
    use: str
    """What is from it."""
    authors: tuple[tuple[str, str], ...]
    """Family name and initials of each author."""
    year: int
    title: str
    journal: str
    volume: int
    issue: str
    """Number of the issue; several have a dash between."""
    pages: tuple[int, int]
    doi: str


ARTICLES = (
    Article(
        "barto1983",
        "the task, and the agent ase-ace",
        (("Barto", "A. G."), ("Sutton", "R. S."), ("Anderson", "C. W.")),
        1983,
        "Neuronlike adaptive elements that can solve difficult learning control problems",
        "IEEE Transactions on Systems, Man, and Cybernetics",
        13,
        "5",
        (834, 846),
        "10.1109/TSMC.1983.6313077",
    ),
    Article(
        "si2001",
        "the noise cases, and the agent ndp",
        (("Si", "J."), ("Wang", "Y.-T.")),
        2001,
        "On-line learning control by association and reinforcement",
        "IEEE Transactions on Neural Networks",
        12,
        "2",
        (264, 276),
        "10.1109/72.914523",
    ),
    Article(
        "williams1992",
        "the agent reinforce",
        (("Williams", "R. J."),),
        1992,
        "Simple statistical gradient-following algorithms for connectionist reinforcement learning",
        "Machine Learning",
        8,
        "3-4",
        (229, 256),
        "10.1007/BF00992696",
    ),
    Article(
        "watkins1992",
        "the agent q-learning",
        (("Watkins", "C. J. C. H."), ("Dayan", "P.")),
        1992,
        "Q-learning",
        "Machine Learning",
        8,
        "3-4",
        (279, 292),
        "10.1007/BF00992698",
    ),
)
"""The sources of the task and of the agents, those first that every study rests on."""


def to_text() -> str:
    """Return how to cite this software and its sources, for reading."""
    software = f"{AUTHORS} ({RELEASED[:4]}). {TITLE} (version {__version__}) [Computer software]."
    lines = ["To cite Upright:", "", *_folded(software, 2), "", "And the sources of what you used:"]
    for article in ARTICLES:
        first, last = article.pages
        names = _joined([f"{family}, {initials}" for family, initials in article.authors])
        lines += [
            "",
            f"  {article.use}:",
            *_folded(f"{names} ({article.year}). {article.title}.", 4),
            *_folded(f"{article.journal} {article.volume}({article.issue}), {first}-{last}.", 4),
            f"    doi:{article.doi}",
        ]
    return "\n".join(lines) + "\n"


def _folded(text: str, indent: int) -> list[str]:
    space = " " * indent
    return textwrap.wrap(
        text, terminal.WIDTH, initial_indent=space, subsequent_indent=space, **UNBROKEN
    )


def _joined(names: list[str]) -> str:
    return " & ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def to_bibtex() -> str:
    """Return the software and its sources as entries for BibTeX."""
    software = {
        "author": f"{{{AUTHORS}}}",
        "title": f"{{{TITLE}}}",
        "version": __version__,
        "year": RELEASED[:4],
    }
    entries = [_entry("software", "upright", software)]
    for article in ARTICLES:
        values = {
            "author": " and ".join(", ".join(name) for name in article.authors),
            "title": f"{{{article.title}}}",
            "journal": article.journal,
            "volume": str(article.volume),
            "number": article.issue.replace("-", "--"),
            "pages": "--".join(map(str, article.pages)),
            "year": str(article.year),
            "doi": article.doi,
        }
        entries.append(_entry("article", article.key, values))
    return "\n".join(entries)


def _entry(kind: str, key: str, values: dict[str, str]) -> str:
    fields = "".join(f"  {name} = {{{value}}},\n" for name, value in values.items())
    return f"@{kind}{{{key},\n{fields}}}\n"


def to_cff() -> str:
    """Return the file CITATION.cff, in version 1.2.0 of the Citation File Format."""
    lines = [
        "cff-version: 1.2.0",
        "message: If you use this software, please cite it as below.",
        "type: software",
        f"title: {json.dumps(TITLE)}",
        "authors:",
        f"  - name: {json.dumps(AUTHORS)}",
        f"version: {json.dumps(__version__)}",
        f"date-released: {json.dumps(RELEASED)}",
        f"license: {LICENSE}",
        "references:",
    ]
    for article in ARTICLES:
        first, last = article.pages
        lines += [
            "  - type: article",
            f"    title: {json.dumps(article.title)}",
            "    authors:",
        ]
        for family, initials in article.authors:
            lines += [f"      - family-names: {family}", f"        given-names: {initials}"]
        lines += [
            f"    journal: {json.dumps(article.journal)}",
            f"    year: {article.year}",
            f"    volume: {article.volume}",
            f"    issue: {json.dumps(article.issue)}",
            f"    start: {first}",
            f"    end: {last}",
            f"    doi: {article.doi}",
        ]
    return "\n".join(lines) + "\n"


FORMATS = {"text": to_text, "bibtex": to_bibtex, "cff": to_cff}
"""The formats of a citation, and the functions that write them."""
