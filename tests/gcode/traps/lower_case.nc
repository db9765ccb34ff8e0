g21 g90 g94
m3 s1000
g0 z5
g0 x0 y0 f600
g1 x10
y10
g0 z5
m5
m30
