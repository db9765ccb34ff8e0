"""The virtual lathe behind NC frames."""
