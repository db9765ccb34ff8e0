"""The daemon: the only package with an event loop, sockets, a serial port and a clock."""
