"""What links look like: surfaces, simplified meshes of files, kinematic chains and people."""
