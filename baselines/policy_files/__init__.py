"""Learned external policies: read from their files, and run as controllers."""
