"""What several learning rules share: boxes, scales, networks, Adam, episodes, histories, policies.

May import what `upright.agents` may, but no agent.
"""
