"""The G-code language, pure: words, cleaning, modal state, check, estimates. No I/O, no clock."""
