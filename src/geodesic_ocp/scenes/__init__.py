"""What there is to see: scenes of arms in motion, told apart from how they are drawn."""
