# Scenic's colour type. Labels have no colours: a colour is what the program says it is, and the default is none.

def _color(r, g, b):
    return (r, g, b)

Color = _module("Color", {
    "withBytes": lambda color: tuple([part / 255 for part in color]),
    "byteToReal": lambda color: tuple([part / 255 for part in color]),
    "realToByte": lambda color: tuple([int(round(255 * part)) for part in color]),
    "uniformColor": lambda: None,
    "defaultCarColor": lambda: None,
    "defaultColor": lambda: None,
}, _color)
CarColor = Color
