(one) G21 (two) G90 ; three (four
G94
M3 S1000 (on)
G0 (up) Z5
G0 X0 Y0 F600
G1 X(5)10
G0 Z5
M5
M30
