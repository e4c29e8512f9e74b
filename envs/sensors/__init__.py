"""What a controller may know of the state, and when."""
