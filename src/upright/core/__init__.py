"""The compiled heart: the physics, the noise, the task and the loop that runs trials.

May import `upright.support` and `upright.errors`; nothing here knows any particular agent.
"""

from upright.support.memory import require_memory

require_memory()
