"""Trials that go on while they are watched, or are watched afterwards, frame by frame."""
