"""The recordings that are analysed, and their subjects."""
