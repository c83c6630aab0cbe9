"""Files of joint angles: tables of comma-separated values and MMM XML."""
