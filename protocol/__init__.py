"""The wire protocols, pure: bytes and `now` in; bytes, events and the next deadline out. No I/O, no clock."""
