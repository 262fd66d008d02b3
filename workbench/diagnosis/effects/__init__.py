"""Effects that a library offers, and models extended by them."""
