"""The configuration: its tables as models, its reading, and where each value comes from."""
