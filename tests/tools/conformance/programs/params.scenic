# sharp: position heading
param weather = Uniform('rain', 'clear')
param time = Range(10, 12)
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
new Object at (20, 3)
