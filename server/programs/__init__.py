"""Programs on disk: their uploads, checks, drawings, and the way from a program to a planner."""
