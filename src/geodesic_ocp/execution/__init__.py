"""Trajectories that a robot can execute: limits, planning in time, checks, replay."""
