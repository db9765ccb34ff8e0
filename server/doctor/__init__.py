"""What is not in order with the computer, the daemon or a machine's port, and what to do."""
