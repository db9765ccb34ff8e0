"""The virtual tool changer."""
