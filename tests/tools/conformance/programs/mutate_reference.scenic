# sharp: heading
ego = new Object at (3, -4)
other = new Object at (20, 5)
new Object ahead of ego by 9
mutate ego by 2
