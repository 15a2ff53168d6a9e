ego = Object at 3 @ -4
other = Object at 20 @ 5, facing 30 deg
mutate other by 2
