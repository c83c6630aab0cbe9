"""Many recordings: their analysis, and statistics over subjects."""
