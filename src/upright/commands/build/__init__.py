"""Build learners for browsers and microcontrollers, by the code that runs here.

What is built learns from nothing, and every bit of it is that of the same run here:
docs/one-source.md explains how.
"""

from typing import Any

from upright.support.registry import Registry

SUBCOMMANDS: Registry[Any] = Registry(
    "command",
    {
        "web": "upright.commands.build.web",
        "chip": "upright.commands.build.chip",
    },
)
"""The commands below this one."""

EXAMPLES = """\
examples:
  upright build web q-learning reinforce --output page     WebAssembly, and a page that uses it
  upright build chip adaptive-lqr --cpu cortex-m7 --output firmware    an object file and C
"""
