"""Learned policies: the `Policy` that plays, and one module for each file format.

May import `upright.agents`, `upright.plants`, `upright.pictures`, `upright.core` and what stands
left of it.
"""
