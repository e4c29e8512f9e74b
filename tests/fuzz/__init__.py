"""Fuzzing: whatever is given, Poise works or says in one line what is wrong.

A kind (`kinds.py`) draws cases as plain JSON and plays them. `tests/integration/test_fuzz.py` plays
a few hundred cases and all that were ever found; `make fuzz` plays for a given time.
"""
