"""A Kalman filter that works by blocks of a machine that is made of like parts."""
