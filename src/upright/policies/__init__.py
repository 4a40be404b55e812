"""What was learned: a policy that plays, and its file formats, one a file.

May import `upright.agents`, `upright.plants` and what stands left of them.
"""
