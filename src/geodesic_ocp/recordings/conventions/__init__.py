"""Joint conventions of recordings, converted through the orientations of segments."""
