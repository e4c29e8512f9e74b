"""The motions that trackers of others follow: clips, what their terms show, where they lie."""
