# sharp: heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
x = Range(5, 15)
y = resample(x)
new Object at (x, 20)
new Object at (y + 4, 30)
