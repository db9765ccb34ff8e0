"""The tool changer and the other inputs and outputs of a machine: LinuxCNC's I/O control, version 2, without I/O."""
