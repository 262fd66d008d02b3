"""What was published of systems: where recordings are to be had, and readers of them."""
