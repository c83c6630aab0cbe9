"""The command check-trajectory, and limits of robots from options."""
