# sharp: position heading
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
n = 0
while True:
    n += 1
    if n == 2:
        continue
    if n > 4:
        break
    new Object at (n * 10, 10)
else:
    new Object at (0, 90)
