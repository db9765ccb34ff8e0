"""Programs with parameters, expressions, O-words and macros to plain G-code: expander.py is the way in."""
