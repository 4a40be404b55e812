"""The command `upright`, as ``python -m upright``."""

from upright.commands import main

if __name__ == "__main__":
    main()
