"""Virtual machines: a second, independent reading of the documents. Imports nothing else of the project."""
