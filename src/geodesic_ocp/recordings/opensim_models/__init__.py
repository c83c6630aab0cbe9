"""OpenSim's models (.osim): joints, forward kinematics, and the segments of the body in them."""
