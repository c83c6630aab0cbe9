"""The metric that explains recorded motions best."""
