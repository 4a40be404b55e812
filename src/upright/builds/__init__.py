"""Learners as machine code for other machines, by the code that runs here."""
