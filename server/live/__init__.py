"""Events on their way to the readers: who gets what, and when."""
