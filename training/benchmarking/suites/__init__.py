"""Suites define the trials of controllers."""
