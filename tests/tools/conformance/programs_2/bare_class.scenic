class Box:
    position: Range(10, 20) @ 9
    width: 2

ego = Object
Box
