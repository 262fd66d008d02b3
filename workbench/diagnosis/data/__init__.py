"""Samples that a diagnosis compares, and what whitens them."""
