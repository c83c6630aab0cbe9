"""Replay of trajectories on simulated robots, in MuJoCo."""
