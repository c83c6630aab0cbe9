"""Problems: which path is sought."""
