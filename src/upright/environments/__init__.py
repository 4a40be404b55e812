"""Gymnasium environments of the cart-pole, one at a time or many at once.

May import `upright.agents`, `upright.plants`, `upright.pictures` and what stands left of them.
"""
