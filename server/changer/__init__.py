"""The tool changer of a machine and what people and the changer itself say to it."""
