"""The virtual Grbl controller."""
