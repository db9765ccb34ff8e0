o100 sub
G1 X#1
o100 endsub
o100 call [5]
M30
