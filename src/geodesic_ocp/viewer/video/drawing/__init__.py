"""A pane of a picture: surfaces and lines of a scene, drawn with a depth buffer."""
