"""Inverse kinematics within the limits of joints, and measures by which motions are compared."""
