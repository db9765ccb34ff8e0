"""Tools for people who work on millstream; no part of the daemon."""
