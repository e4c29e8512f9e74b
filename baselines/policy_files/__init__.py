"""Learned policies from outside: read from their files, and run as controllers."""
