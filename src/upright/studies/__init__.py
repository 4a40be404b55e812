"""Runs and studies: cases, random streams, the store, tuning, playing, watching.

May import everything but `upright.reports`, `upright.nodes` and `upright.commands`.
"""
