"""Poses of the hand: mapped to the robot, targets, what is within reach and what mounting helps."""
