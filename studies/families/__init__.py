"""The families: what lies between their knots."""
