"""What is known of markers before the fit: rigid poses, axes, and angles to start from."""
