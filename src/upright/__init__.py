"""Upright: learning to balance an inverted pendulum."""

from upright.environments.registration import register_environments

__version__ = "0.1.0"

register_environments()
