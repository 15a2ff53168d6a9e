# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
last = ego
for i in range(4):
    last = new Object ahead of last by Range(1, 2), facing Range(-5, 5) deg relative to last.heading
