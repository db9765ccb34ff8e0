"""What is kept: backups of the daemon's data, seals over the history, and how long it stays."""
