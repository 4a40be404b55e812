"""What custom agents are held to, and how their failures are reported.

The package's own agents never pass through these checks.
"""
