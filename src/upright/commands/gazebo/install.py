"""Install Gazebo 11, without root, and build the plugin that steps it.

If Gazebo 11 is on the path, it is used. Otherwise Debian's packages are unpacked into a folder of
your own (the variable UPRIGHT_GAZEBO names another); nothing else on the machine changes. If
interrupted, the same command continues where it stopped. It needs cmake, g++, apt-get and dpkg-deb.
"""

import argparse

from upright.commands.parser import Parser

EXAMPLES = """\
examples:
  upright gazebo install
  upright gazebo install --mirror https://mirror.example/debian
  upright gazebo install --remove
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright gazebo install`."""
    parser.add_argument(
        "--mirror", metavar="URL", help="a mirror of Debian's archive (default: the machine's)"
    )
    parser.add_argument(
        "--remove",
        action="store_true",
        help="remove everything that was downloaded and built instead",
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright gazebo install`."""
    from upright.plants.gazebo.installer import install, remove, size

    if options.remove:
        print(f"freed: {size(remove())}")
        return 0
    found = install(options.mirror)
    print(f"Gazebo {found.version}: {found.server}")
    print(f"plugin: {found.plugin}")
    return 0
