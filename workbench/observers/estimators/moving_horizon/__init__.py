"""The moving horizon estimator: least squares over a window of samples."""
