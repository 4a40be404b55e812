"""Runs and studies: cases, random streams, the store, tuning, playing and watching.

May import everything except `upright.reports`, `upright.nodes` and `upright.commands`.
"""
