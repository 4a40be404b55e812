"""The compiled heart: what happens in a step of a trial, and what a task is.

May import `upright.support` and `upright.errors`.
"""
