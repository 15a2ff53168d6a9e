"""Does a label match a scenario? Read `matcher` first."""
