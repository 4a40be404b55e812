"""Upright: learning to balance an inverted pendulum."""

__version__ = "0.1.0"
