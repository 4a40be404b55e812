"""The `upright` command.

May import everything.
"""
