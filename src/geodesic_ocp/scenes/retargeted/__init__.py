"""What there is to see of a retargeting: the person, the robots, and curves over time."""
