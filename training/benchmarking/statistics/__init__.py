"""Numbers in, numbers out: rates, fits, intervals, differences."""
