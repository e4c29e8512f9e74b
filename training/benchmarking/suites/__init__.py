"""Suites choose the trials that controllers play."""
