"""Statistics of many recordings, over subjects."""
