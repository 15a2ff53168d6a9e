ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5
other = new Object offset by (Range(-3, 3), Normal(15, 2)), facing Range(-90, 90) deg, with requireVisible False
new Object ahead of other by Range(1, 9), facing (TruncatedNormal(0, 30, -60, 90) deg) relative to other, with requireVisible False
