"""The command `upright`, as ``python -m upright``."""

from upright.commands.cli import main

if __name__ == "__main__":
    main()
