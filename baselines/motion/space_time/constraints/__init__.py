"""What a user may ask of a motion besides the clip."""
