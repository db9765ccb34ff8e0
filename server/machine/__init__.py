"""One machine: its line, its state, its job's stream, and what people ask of it by hand."""
