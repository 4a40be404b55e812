"""Statistics, tables and plots of studies, beside the published figures.

May import everything but `upright.nodes` and `upright.commands`.
"""
