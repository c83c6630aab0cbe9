"""The analysis of many recordings in parallel."""
