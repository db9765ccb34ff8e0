"""The virtual ElVinto mill."""
