"""What several learning rules share: boxes, least squares, the form of a policy.

May import what `upright.agents` may.
"""
