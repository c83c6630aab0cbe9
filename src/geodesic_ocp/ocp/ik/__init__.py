"""Inverse kinematics and pose errors."""
