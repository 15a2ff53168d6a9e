ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
a = new Object at (20, 0), facing 20 deg, with width 2
b = new Object at (30, 9), facing 50 deg, with width 3
chosen = Uniform(a, b)
third = new Object at (Range(-20, 20), 30), with width 1
require (distance from third to chosen) < 35 and (relative heading of chosen from third) > 30 deg
