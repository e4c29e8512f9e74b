"""Learned policies from outside: read from their files, and played as controllers."""
