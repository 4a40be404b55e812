"""What any program needs: settings as values, files, processes, interrupts. Knows no pendulum.

May import `upright.errors`.
"""
