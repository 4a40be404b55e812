"""Drawings of the cart-pole: as pixels, as text, in a window, as a video.

May import `upright.core` and what stands left of it.
"""
