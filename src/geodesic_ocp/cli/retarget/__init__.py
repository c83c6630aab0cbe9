"""The command retarget."""
