# sharp: position heading
param note = f'{3}-{"x".upper()}'
ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
word = 'left right'.split()[1]
new Object at ({'left': -20, 'right': 20}[word], 3)
