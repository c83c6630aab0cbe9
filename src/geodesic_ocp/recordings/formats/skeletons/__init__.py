"""Files of motions of skeletons."""
