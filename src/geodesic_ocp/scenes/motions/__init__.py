"""Models that move over time: motions, trajectories, replays."""
