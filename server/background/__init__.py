"""What takes long or waits for the disk: the thread of the database, workers, and a process for large programs."""
