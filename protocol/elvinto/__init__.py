"""The ElVinto exchange standard, version 11: codec, dialect and engine."""
