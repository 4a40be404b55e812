"""What any program needs: settings, files, processes, interrupts. Nothing here is about pendulums.

May import `upright.errors`.
"""
