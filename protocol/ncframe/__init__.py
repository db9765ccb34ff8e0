"""NC frames: binary blocks for a microcontroller lathe (docs/ncframe.md)."""
