"""What commands write and what tests are refused, kept so that two states can be compared."""
