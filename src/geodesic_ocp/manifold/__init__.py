"""What follows from the metric tensor by differentiation and integration."""
