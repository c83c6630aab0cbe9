"""The command solve."""
