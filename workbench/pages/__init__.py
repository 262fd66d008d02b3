"""The kit of figures and pages; knows no result."""
