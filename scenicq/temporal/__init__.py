"""Does a stretch of a recording match a dynamic program?"""
