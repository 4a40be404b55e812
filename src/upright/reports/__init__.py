"""Statistics, tables and plots of studies, beside the published figures.

May import everything except `upright.nodes` and `upright.commands`.
"""
