"""HTTP and WebSocket routes: they translate requests into calls of the services and nothing else."""
