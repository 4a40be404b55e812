"""Gymnasium environments of the cart-pole, one at a time or many at once.

May import `upright.agents`, `upright.plants`, `upright.pictures`, `upright.core` and what stands
left of it.
"""
